"""Metrics: whole numbers counted in each window, and the figures that follow from their sums; one module each."""
