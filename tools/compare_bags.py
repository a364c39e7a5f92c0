"""Write real recordings as ROS 2 bags, convert them, and hold grids and scores against those of the tree itself.

Prints a table (Markdown): for each way of writing the bags the share of cells that are equal, of all cells, of those
that either grid knows, and of those up to 60 m ahead, and the score of two baselines. Each recording of TREE, a
Cityscapes sequence tree, becomes a bag of each kind.

Example: PYTHONPATH=.:tests python tools/compare_bags.py TREE --labels TREE/pred_sequence --out build/bags
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from support.bags import RecordingBag, Variant

import semgrid_eval as sg
from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.build import build_log
from semgrid_eval.log.convert import ConversionSummary, Work
from semgrid_eval.log.store import find_logs
from semgrid_eval.sources.cityscapes.tree import CityscapesOptions, convert_cityscapes, find_sequences
from semgrid_eval.sources.ros2.convert import Ros2Options, convert_bags

VARIANTS = {
    "DisparityImage; rgb8; Odometry, its twist": Variant(),
    "the same, sqlite3": Variant(storage="sqlite3"),
    "DisparityImage; PNG; TwistStamped": Variant(image="png", labels="png", motion="twist"),
    "DisparityImage; JPEG; TwistStamped and Imu, sqlite3": Variant("sqlite3", "jpeg", labels="png", motion="imu"),
    "depth 32FC1 in m; bgr8; Odometry, its twist": Variant(image="bgr8", depth="32FC1"),
    "depth 16UC1 in mm; mono8; Odometry, its twist": Variant(image="mono8", depth="16UC1"),
    "depth 16UC1 in mm, compressed; JPEG": Variant(image="jpeg", depth="compressedDepth"),
    "DisparityImage; rgb8; Odometry, its poses": Variant(motion="pose"),
}
MATRIX = """
defaults: {window: {step_frames: 3, target_frame: null}}
rows:
- {name: BL-DC, model: newest}
- {name: BL-Fuse, model: fuse}
"""
SPEC, NEAR_M = sg.GridSpec(), 60.0
Grids = dict[tuple[str, int], np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]
"""Grids (S, F, H, W) by the city and the stretch of a log."""


def main() -> None:
    """Parse the options, convert, compare, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tree", type=Path)
    parser.add_argument("--labels", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    try:
        _compare(CityscapesOptions(src=options.tree, labels=options.labels), options.out)
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None


def _compare(tree: CityscapesOptions, out: Path) -> None:
    (out / "matrix.yaml").parent.mkdir(parents=True, exist_ok=True)
    (out / "matrix.yaml").write_text(MATRIX)
    _require_whole(convert_cityscapes(tree, out / "tree"))
    expected = _grids(out / "tree")
    print("| bag | equal cells | of those that either knows | of those, up to 60 m | BL-DC | BL-Fuse |")
    print("|---|---|---|---|---|---|")
    print(f"| (the tree itself) | | | | {_scores(out, 'tree')} |")
    for number, (what, variant) in enumerate(VARIANTS.items()):
        folder = f"variant{number}"
        _require_whole(_converted(tree, variant, out / folder))
        shares = " | ".join(f"{share:.2%}" for share in _equal(_grids(out / folder / "logs"), expected))
        print(f"| {what} | {shares} | {_scores(out, f'{folder}/logs')} |", flush=True)


def _converted(tree: CityscapesOptions, variant: Variant, folder: Path) -> ConversionSummary:
    bags = []
    for sequence in find_sequences(tree):
        bag = folder / sequence.name
        bags.append(bag if bag.exists() else RecordingBag(sequence.recording(), variant).write(bag))
    (folder / "map.yaml").write_text(variant.map_text)
    return convert_bags(Ros2Options(bag=tuple(bags), map=str(folder / "map.yaml")), folder / "logs", Work(workers=1))


def _require_whole(summary: ConversionSummary) -> None:
    for label, reason in summary.failed.items():
        raise SystemExit(f"Error: {label}: {reason}")


def _grids(folder: Path) -> Grids:
    return dict(_built(folder))


def _built(folder: Path) -> Iterator[tuple[tuple[str, int], np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]]:
    for log in find_logs(folder):
        for number, found in enumerate(build_log(log, sg.GridConfig())):
            yield (found.name.partition("_")[0], number), found.grids


def _equal(found: Grids, expected: Grids) -> tuple[float, ...]:
    """Return the share of equal cells: of all; of those that one or the other knows; and of those up to 60 m ahead."""
    assert found.keys() == expected.keys()
    ours, theirs = (np.concatenate([grids[key][0] for key in expected]) for grids in (found, expected))
    equal, known = ours == theirs, (ours > 0) | (theirs > 0)
    near = np.arange(SPEC.rows) >= SPEC.agent_row - NEAR_M / SPEC.cell_m
    return tuple(float(equal[each].mean()) for each in (known | True, known, known & near[:, None]))


def _scores(out: Path, logs: str) -> str:
    run = out / f"{logs.replace('/', '-')}-run"
    sg.run(out / "matrix.yaml", out / logs, run)
    table = sg.load_run(run)
    wanted = {"metric": "iou", "division": "all", "region": "all", "column": "mean_known"}
    means = table[(table[list(wanted)] == list(wanted.values())).all(axis=1)]
    return " | ".join(f"{means[means.row == row].value.iloc[0]:.4f}" for row in ("BL-DC", "BL-Fuse"))


if __name__ == "__main__":
    main()
