"""Logs of the Argoverse 2 Sensor data set."""
