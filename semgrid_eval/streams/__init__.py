"""Streaming: what a model's answers are worth at the time at which they are there."""
