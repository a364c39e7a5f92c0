"""The paper: its table, its claims, and what a run says of them."""
