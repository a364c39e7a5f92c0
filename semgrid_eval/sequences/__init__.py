"""Windows of input and target grids, and batches of them."""
