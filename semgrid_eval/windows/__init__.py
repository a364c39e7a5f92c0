"""Windows: which frames are inputs and target, and batches of them."""
