"""Bad inputs of every kind: good files, what spoils them, and the command that then ends in one line."""
