"""Experiment matrices that come with the package."""
