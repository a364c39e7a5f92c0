"""Disturbances: what may be wrong with a model's inputs, so that it can be said what a model loses by it."""
