"""A simulated town, its traffic, and the stereo camera that drives through it."""
