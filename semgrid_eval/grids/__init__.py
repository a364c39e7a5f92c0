"""Semantic grids: from labelled points to aligned bird's-eye cells."""
