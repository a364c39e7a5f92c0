"""A run as an MCAP log to play in a viewer."""
