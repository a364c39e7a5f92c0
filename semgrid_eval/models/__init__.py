"""Models: the protocol, the table of names, the one loop that trains, and one module for each model."""
