"""Plans the recordings of a synthetic data set: which towns, which windows, which split."""

import importlib.util
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semgrid_eval.errors import MissingExtraError
from semgrid_eval.progress import Progress
from semgrid_eval.sources.town.config import SyntheticConfig
from semgrid_eval.sources.town.drives import choose_drives
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.rendering import CONDITIONS, RecordingPlan
from semgrid_eval.sources.town.town import TownSpec, load_town, prepare_town
from semgrid_eval.sources.town.varied import draw_conditions


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
            rig=config.rig,
        )
        for position, chosen in enumerate(drives)
    ]
    return plans if config.errors == "fixed" else [_varied(plan) for plan in plans]


def _varied(plan: RecordingPlan) -> RecordingPlan:
    """Draw the conditions of a recording, which leaves all its other random numbers alone."""
    rng = np.random.default_rng(plan.seed).spawn(CONDITIONS + 1)[CONDITIONS]
    drawn = draw_conditions(plan.width_px, plan.height_px, rng)
    return replace(plan, drawn=drawn, width_px=drawn.width_px, height_px=drawn.height_px)
