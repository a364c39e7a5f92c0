"""Experiment matrices and the runner that works them off."""
