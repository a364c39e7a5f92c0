"""JSON and YAML that `tools/fuzz.py` changes, whole and bad."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

from support.bad import cityscapes, contracts, matrices, yaml_files
from support.cityscapes_tree import CAMERA

from semgrid_eval.config import load_yaml
from semgrid_eval.log.contract import contract_text, load_contract
from semgrid_eval.log.default_contract import default_contract
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.sources.cityscapes.files import read_camera, read_stamp, read_vehicle

CORPUS: dict[str, Mapping[str, bytes]] = {
    "camera": cityscapes.CAMERA_BYTES,
    "contract": contracts.CONTENTS,
    "matrix": matrices.FILE_BYTES | matrices.ROW_BYTES | matrices.STREAM_BYTES,
    "png": cityscapes.PNG_BYTES,
    "timestamp": cityscapes.STAMPS,
    "vehicle": cityscapes.VEHICLE_BYTES,
    "yaml": yaml_files.CONTENTS,
}
"""Inputs that are bad, by kind and words."""
READERS: dict[str, Callable[[Path], object]] = {
    "camera": read_camera,
    "contract": load_contract,
    "matrix": lambda path: load_matrix(str(path)),
    "timestamp": read_stamp,
    "vehicle": lambda path: read_vehicle(path, 0),
    "yaml": load_yaml,
}
PRESETS = Path(__file__).parents[2] / "semgrid_eval" / "presets"


def json_inputs(folder: Path) -> dict[str, bytes]:
    vehicle = {"speed": 5.5, "yawRate": 0.1, "gpsLatitude": 49.1, "gpsLongitude": 8.2, "gpsHeading": None}
    made = {"camera/whole": json.dumps(CAMERA).encode(), "vehicle/whole": json.dumps(vehicle).encode()}
    return made | {"timestamp/whole": b"17000\n"} | corpus("camera", "vehicle", "timestamp")


def yaml_inputs(folder: Path) -> dict[str, bytes]:
    made = {"contract/default.yaml": contract_text(default_contract()).encode()}
    made |= {f"matrix/{path.name}": path.read_bytes() for path in PRESETS.glob("*.yaml")}
    bad = corpus("contract", "matrix", "yaml")
    return made | dict(list(bad.items())[::8])  # most that is made of what is bad is bad, too


def read_of_kind(folder: Path, name: str) -> object:
    return READERS[name.partition("/")[0]](folder / name)


def corpus(*kinds: str) -> dict[str, bytes]:
    """Bad inputs by kind and number, those that are bad by their size alone left out."""
    found = {kind: [data for data in CORPUS[kind].values() if len(data) < 1 << 15] for kind in kinds}
    return {f"{kind}/{number}": data for kind in kinds for number, data in enumerate(found[kind])}
