"""MCAP logs: the border between sources and everything that reads."""
