"""What makes recordings: each source behind one call of the library."""
