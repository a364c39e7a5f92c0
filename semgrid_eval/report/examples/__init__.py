"""Example windows: which are chosen, and their pictures."""
