"""Plans the recordings of a synthetic data set: which towns, which windows, which split."""

import importlib.util
import math
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from semgrid_eval.config import Config
from semgrid_eval.errors import MissingExtraError
from semgrid_eval.progress import Progress
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.drives import FRAME_COUNT, choose_drives, needed_s
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.rendering import CONDITIONS, RecordingPlan
from semgrid_eval.sources.town.town import TownSpec, load_town, prepare_town
from semgrid_eval.sources.town.varied import draw_conditions

_STEREO = (
    "Errors of labels, disparity and motion: drawn from a model; or disparity from matching a rendered stereo pair; "
    "or none."
)
_ERRORS = (
    "Camera and strength of errors: the same in all recordings, or drawn for each; width and height then say how many "
    "pixels images have about."
)
_VAL_TOWNS = "Towns for validation, if it is another share than of the recordings."
_TOWN_SIZE = "Side of the square that streets cover."
_FRAMES = "Of a recording, at 17 a second; 340 are 20 s."
_DURATION = "Simulated time of a town from which recordings are taken."
_POSITIONS_PER_KM2_S = 25_000
_MAX_POSITIONS = 10_000_000  # of everybody in a town at every step; they are held in memory, some 200 bytes each


class SyntheticConfig(Config):
    """What a synthetic data set is made of."""

    recordings: Annotated[int, Field(ge=1, le=100_000, description="How many.")]
    frames: Annotated[int, Field(ge=2, le=20_000, description=_FRAMES)] = FRAME_COUNT
    seed: Annotated[int, Field(ge=0, lt=1 << 31, description="The same seed gives the same bytes.")] = 0
    towns: Annotated[int, Field(ge=1, le=100, description="How many; each belongs to one split only.")] = 4
    val_share: Annotated[
        float, Field(ge=0.0, lt=1.0, description="Share of recordings, and of towns, for validation.")
    ] = 0.3
    val_towns: Annotated[int | None, Field(ge=1, description=_VAL_TOWNS)] = None
    town_size_m: Annotated[float, Field(ge=250.0, le=2000.0, description=_TOWN_SIZE)] = 450.0
    duration_s: Annotated[float, Field(ge=10.0, le=3600.0, description=_DURATION)] = 90.0
    width: Annotated[int, Field(ge=64, le=4096, description="Width of the images in pixels.")] = 512
    height: Annotated[int, Field(ge=32, le=2048, description="Height of the images in pixels.")] = 256
    stereo: Annotated[Stereo, Field(description=_STEREO)] = "modelled"
    errors: Annotated[Literal["fixed", "varied"], Field(description=_ERRORS)] = "fixed"

    @model_validator(mode="after")
    def _splits_need_towns(self) -> Self:
        if self.val_share > 0.0 and self.towns < 2:
            raise ValueError("training and validation need different towns: ask for 2 towns or more, or val_share 0")
        if self.val_towns is not None and not (self.val_share > 0.0 and self.val_towns < self.towns):
            raise ValueError("val_towns must leave a town for training, and val_share recordings for validation")
        return self

    @model_validator(mode="after")
    def _drives_fit_in_time(self) -> Self:
        if (longest_s := needed_s(self.frames)) > self.duration_s:
            least = f"a drive of {self.frames} frames needs a town of {math.ceil(longest_s)} s or more"
            raise ValueError(f"{least}, not {self.duration_s:g} s: ask for a longer duration_s or fewer frames")
        return self

    @model_validator(mode="after")
    def _town_fits_in_memory(self) -> Self:
        positions = _POSITIONS_PER_KM2_S * (self.town_size_m / 1000.0) ** 2 * self.duration_s
        if positions > _MAX_POSITIONS:
            longest_s = int(self.duration_s * _MAX_POSITIONS / positions)
            most = f"a town of {self.town_size_m:g} m can be simulated for {longest_s} s at most"
            raise ValueError(f"{most}; ask for more towns")
        return self


def plan_recordings(
    config: SyntheticConfig, cache_dir: Path, progress: Progress, *, workers: int = 1, dataset: str = "synthetic"
) -> list[RecordingPlan]:
    """Simulate the towns that the cache does not hold yet, some at a time, and choose the windows of all recordings.

    Progress is called for each finished town. A town whose traffic holds too few windows is an InputError.
    """
    if importlib.util.find_spec("embreex") is None:  # otherwise first noticed minutes later, when rendering begins
        raise MissingExtraError("synthetic", "embreex")
    shares = [share for share in _shares(config) if share.recordings > 0]
    folders = _prepare_towns([share.town for share in shares], cache_dir, progress, workers)
    plans: list[RecordingPlan] = []
    for share, folder in zip(shares, folders, strict=True):
        plans += _plans_of_town(config, share, folder, len(plans))
    return [replace(plan, dataset=dataset) for plan in plans]


@dataclass(frozen=True)
class _Share:
    """One town's part of a data set."""

    town: TownSpec
    split: str
    recordings: int


def _shares(config: SyntheticConfig) -> list[_Share]:
    """Share out towns to splits, of the same kinds in the same order for each, and recordings to towns."""
    # Training keeps a town, however large the share of validation is.
    by_share = min(config.towns - 1, max(1, round(config.towns * config.val_share))) if config.val_share > 0.0 else 0
    val_towns = config.val_towns or by_share
    val_recordings = round(config.recordings * config.val_share)
    shares: list[_Share] = []
    for split, towns, recordings in (
        ("train", config.towns - val_towns, config.recordings - val_recordings),
        ("val", val_towns, val_recordings),
    ):
        for position in range(towns):
            kind = KINDS[position % len(KINDS)].name
            spec = TownSpec(len(shares), kind, config.seed, config.town_size_m, config.duration_s)
            shares.append(_Share(spec, split, (recordings + towns - 1 - position) // towns))
    return shares


def _prepare_towns(specs: list[TownSpec], cache_dir: Path, progress: Progress, workers: int) -> list[Path]:
    """Return the towns' folders in order; threads suffice, because the long part of each is SUMO's own process."""
    with ThreadPoolExecutor(max_workers=max(workers, 1)) as executor:
        waiting = {executor.submit(prepare_town, spec, cache_dir): spec for spec in specs}
        try:
            for done, future in enumerate(as_completed(waiting), start=1):
                future.result()
                progress(done, len(specs), f"town {waiting[future].index} ({waiting[future].kind})")
        finally:
            executor.shutdown(cancel_futures=True)
        return [future.result() for future in waiting]


def _plans_of_town(config: SyntheticConfig, share: _Share, folder: Path, first: int) -> list[RecordingPlan]:
    spec = share.town
    traffic = load_town(folder).traffic
    drives = choose_drives(traffic, share.recordings, np.random.default_rng([spec.seed, spec.index, 1]), config.frames)
    plans = [
        RecordingPlan(
            name=f"town{spec.index:02d}_{first + position:06d}_000000",
            split=share.split,
            town=folder,
            town_digest=spec.digest(),
            drive=chosen,
            seed=(spec.seed, spec.index, 2, position),
            width_px=config.width,
            height_px=config.height,
            stereo=config.stereo,
        )
        for position, chosen in enumerate(drives)
    ]
    return plans if config.errors == "fixed" else [_varied(plan) for plan in plans]


def _varied(plan: RecordingPlan) -> RecordingPlan:
    """Draw the conditions of a recording, which leaves all its other random numbers alone."""
    rng = np.random.default_rng(plan.seed).spawn(CONDITIONS + 1)[CONDITIONS]
    drawn = draw_conditions(plan.width_px, plan.height_px, rng)
    return replace(plan, drawn=drawn, width_px=drawn.width_px, height_px=drawn.height_px)
