"""Write a tree in Cityscapes' layout again with pictures of another size, to measure what Cityscapes' own size costs.

Example: python tools/scaled_tree.py TREE OUT --size 2048 1024

Images are interpolated, so their PNG files are somewhat smaller than those of a camera; disparity is taken from the
nearest pixel and grows with the width, as do the intrinsics of camera files. Everything else is copied.
"""

import argparse
import json
from pathlib import Path

import cv2
import numpy as np

from semgrid_eval.recording.png import decode_colour, decode_gray, encode, encode_gray

_INTRINSICS = {"fx": 0, "fy": 1, "u0": 0, "v0": 1}


def scaled(path: Path, size: tuple[int, int], known: tuple[int, int]) -> bytes:
    """Return what a file of the tree becomes at a size (width, height), from one where pictures have another."""
    data = path.read_bytes()
    if path.name.endswith("_leftImg8bit.png"):
        picture = cv2.resize(decode_colour(data)[..., ::-1], size, interpolation=cv2.INTER_CUBIC)
        return encode(np.asarray(picture, np.uint8))
    if path.name.endswith("_disparity.png"):
        coded = cv2.resize(decode_gray(data, bit_depth=16), size, interpolation=cv2.INTER_NEAREST).astype(np.float64)
        larger = np.where(coded > 0, (coded - 1) * size[0] / known[0] + 1, 0)
        return encode_gray(np.minimum(larger, 65535).astype(np.uint16))
    if path.name.endswith("_camera.json"):
        content = json.loads(data)
        for name, side in _INTRINSICS.items():
            content["intrinsic"][name] *= size[side] / known[side]
        return json.dumps(content).encode()
    return data


def main() -> None:
    """Scale a tree; label images are left out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tree", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, nargs=2, default=(2048, 1024), metavar=("WIDTH", "HEIGHT"))
    given = parser.parse_args()
    width, height = given.size
    for channel in ("leftImg8bit_sequence", "disparity_sequence", "camera", "vehicle_sequence", "timestamp_sequence"):
        for path in sorted(path for path in (given.tree / channel).rglob("*") if path.is_file()):
            beside = given.tree / "leftImg8bit_sequence" / path.parent.relative_to(given.tree / channel)
            known = decode_colour(next(beside.glob("*.png")).read_bytes()).shape[1::-1]
            target = given.out / path.relative_to(given.tree)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(scaled(path, (width, height), known))


if __name__ == "__main__":
    main()
