"""The simulated town: traffic by SUMO, pictures by ray casting.

Where SUMO or Embree is not installed, what needs it raises a MissingExtraError; where SUMO fails or the folder of towns
cannot be used, an InputError.
"""
