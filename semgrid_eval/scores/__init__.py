"""Scores: integer confusion counts per window and what follows from them."""
