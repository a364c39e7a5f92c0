"""The simulated town: traffic by SUMO, pictures by ray casting."""
