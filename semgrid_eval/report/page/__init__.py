"""The page, and what stands on it in words."""
