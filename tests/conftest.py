"""Settings of the whole suite: the same examples every time, no clocks."""

from hypothesis import settings

settings.register_profile("suite", deadline=None, derandomize=True, database=None)
settings.load_profile("suite")
