"""Sequences in the layout of KITTI's odometry benchmark and of SemanticKITTI."""
