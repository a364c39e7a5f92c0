"""Settings of the whole suite: the same examples every time, no clocks."""

from hypothesis import settings

from semgrid_eval.ray_executor import keep_to_this_machine

keep_to_this_machine()  # before any module of tests imports Ray
settings.register_profile("suite", deadline=None, derandomize=True, database=None)
settings.load_profile("suite")
