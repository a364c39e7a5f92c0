"""Sources: where calibrated camera frames and motion come from."""
