"""The rows of runs as read from disk, and which is compared with which."""
