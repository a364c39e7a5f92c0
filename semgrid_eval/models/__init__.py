"""Predictors: baselines and the encoder-decoder, with its training."""
