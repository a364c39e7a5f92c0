"""What `tools/fuzz.py` mutates: whole inputs of each kind, how they are changed, what reads them and must agree."""

import random
import re
from functools import partial
from pathlib import Path

from support.fuzzing_bags import bag_inputs, read_bag
from support.fuzzing_clouds import changed_clouds, cloud_inputs, read_clouds
from support.fuzzing_logs import log_agrees, log_inputs, read_log, recovered, recovery_agrees, resealed
from support.fuzzing_pictures import all_png_inputs, png_inputs, read_png, resealed_png
from support.fuzzing_texts import json_inputs, read_of_kind, yaml_inputs
from support.fuzzing_ways import Inputs, Kind, anyhow, never, words
from support.mutations import KINDS as KEPT
from support.mutations import make_run


def kept_inputs(kind: str, folder: Path) -> dict[str, bytes]:
    run = make_run(folder) if not (folder / "run").exists() else folder / "run"
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(run.glob(KEPT[kind][0]))}


def read_kept(kind: str, owners: dict[str, str], folder: Path, name: str) -> object:
    path = folder / name
    if name not in owners:  # it is whole when it is read first
        owners[name] = re.findall(rb"semgrid-eval seal (\S+) ", path.read_bytes())[-1].decode()
    KEPT[kind][1](path, owners[name])
    return True


def or_another(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change a file, or put another of its kind in its place."""
    others = [data for data in inputs.values() if data != inputs[name]]
    return chance.choice(others) if others and chance.random() < 0.1 else anyhow(inputs, name, chance)


def _kept(kind: str) -> Kind:
    return Kind(partial(kept_inputs, kind), partial(read_kept, kind, {}), or_another, agrees=never)


KINDS: dict[str, Kind] = {
    "log": Kind(log_inputs, read_log, anyhow, agrees=log_agrees),
    "recovery": Kind(log_inputs, recovered, anyhow, agrees=recovery_agrees),
    "resealed log": Kind(log_inputs, read_log, resealed, has_checksums=False),
    "png": Kind(png_inputs, read_png, anyhow),
    "resealed png": Kind(all_png_inputs, read_png, resealed_png, has_checksums=False),
    "json": Kind(json_inputs, read_of_kind, words, has_checksums=False),
    "yaml": Kind(yaml_inputs, read_of_kind, words, has_checksums=False),
    "bag": Kind(bag_inputs, read_bag, anyhow, has_checksums=False),
    "cloud": Kind(cloud_inputs, read_clouds, changed_clouds, has_checksums=False),
    **{kind: _kept(kind) for kind in KEPT},
}
