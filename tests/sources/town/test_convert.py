"""How the frozen benchmarks are made, and by what."""

import pytest

from semgrid_eval.sources.benchmarks import BENCHMARKS, load_benchmark
from semgrid_eval.sources.town.convert import config_of, versions


@pytest.mark.parametrize("name", BENCHMARKS)
def test_what_is_published_was_made_by_this_town_builder_and_renderer(name):
    for chosen in load_benchmark(name).sizes.values():
        if chosen.fingerprints is not None:
            assert len(chosen.fingerprints.split()) == chosen.train.recordings + chosen.val.recordings
            made_by = {key: chosen.versions[key] for key in ("renderer", "town builder")}
            assert made_by.items() <= versions().items()


def test_the_configuration_follows_the_definition():
    benchmark = load_benchmark("town-v1")
    config = config_of(benchmark, "small")
    assert (config.recordings, config.towns, config.val_towns, config.seed) == (420, 20, 8, 2019)
    assert round(config.recordings * config.val_share) == 120
    assert (config.width, config.height, config.stereo) == (512, 256, "modelled")
    assert benchmark.dataset("small") == "town-v1/small"


def test_versions_name_what_renders():
    packages = {"eclipse-sumo", "embreex", "numpy", "opencv-python-headless"}
    assert packages | {"processor", "renderer", "town builder"} == set(versions())
