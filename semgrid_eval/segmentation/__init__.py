"""Label images where a log has none: a segmentation network looks at the colour images."""
