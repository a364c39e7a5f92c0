"""Label images for logs without any, by a segmentation network that sees their colour images."""
