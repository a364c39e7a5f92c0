"""What a recording is: calibrated camera frames, motion and truth; pictures as PNG files."""
