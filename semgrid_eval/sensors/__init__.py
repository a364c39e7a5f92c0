"""Sensors: each kind turns a log into labelled points in the vehicle frame with their time."""
