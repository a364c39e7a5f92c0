"""Partitions: where in the grid the cells lie that a metric counts apart; one module each."""
