"""The simulated town: traffic by SUMO, pictures by ray casting.

What fails, SUMO itself or the folder of towns, is an InputError; where SUMO or Embree is not installed, what needs it is
a MissingExtraError.
"""
