"""How a benchmark's recordings are made: what to plan, and by which versions of what their bytes depend on."""

import platform
from collections.abc import Mapping

from semgrid_eval.log.benchmarks import Benchmark, SizeName
from semgrid_eval.packages import installed_versions
from semgrid_eval.sources.town.recordings import SyntheticConfig
from semgrid_eval.sources.town.rendering import RENDER_VERSION
from semgrid_eval.sources.town.town import TOWN_VERSION

_PACKAGES = ("numpy", "opencv-python-headless", "eclipse-sumo", "embreex")


def config_of(benchmark: Benchmark, size: SizeName) -> SyntheticConfig:
    """Return what `plan_recordings` needs for one size of a benchmark."""
    chosen = benchmark.sizes[size]
    recordings = chosen.train.recordings + chosen.val.recordings
    return SyntheticConfig(
        recordings=recordings,
        seed=chosen.seed,
        width=benchmark.width,
        height=benchmark.height,
        stereo=benchmark.stereo,
        towns=chosen.train.towns + chosen.val.towns,
        val_share=chosen.val.recordings / recordings,
        val_towns=chosen.val.towns,
        town_size_m=benchmark.town_size_m,
        duration_s=benchmark.duration_s,
    )


def changed_versions(made_with: Mapping[str, str]) -> dict[str, tuple[str, str | None]]:
    """Return what published recordings were made with and what is here instead, None where nothing is."""
    here = versions()
    return {what: (theirs, here.get(what)) for what, theirs in made_with.items() if here.get(what) != theirs}


def versions() -> dict[str, str]:
    """Return the versions of what the bytes of a recording depend on, and the processor's kind."""
    own = {"processor": platform.machine(), "town builder": str(TOWN_VERSION), "renderer": str(RENDER_VERSION)}
    return dict(sorted((own | installed_versions(_PACKAGES)).items()))
