"""Figures with intervals: the paired bootstrap."""
