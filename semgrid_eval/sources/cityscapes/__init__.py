"""Trees in the layout of Cityscapes' sequences."""
