import numpy as np
import pytest

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES, MASK_COLOUR
from semgrid_eval.report.examples.drawing import class_legend, class_style

# Machado, Oliveira and Fernandes 2009: linear sRGB as seen without one kind of cone.
VISIONS = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_CONES = [[0.4122215, 0.5363325, 0.0514460], [0.2119035, 0.6806995, 0.1073970], [0.0883025, 0.2817188, 0.6299787]]
TO_OKLAB = [[0.2104543, 0.7936178, -0.0040720], [1.9779985, -2.4285922, 0.4505937], [0.0259040, 0.7827718, -0.8086758]]


def _least_distance(palette, vision):
    """The least distance of two colours in Oklab, M's white among them, in hundredths of black to white."""
    shares = np.vstack([palette, MASK_COLOUR]) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.transpose(VISIONS[vision]), 0, 1)
    places = np.cbrt(seen @ np.transpose(TO_CONES)) @ np.transpose(TO_OKLAB)
    distances = np.linalg.norm(places[:, None] - places, axis=-1)
    return 100 * distances[~np.eye(len(places), dtype=bool)].min()


@pytest.mark.parametrize("vision", VISIONS)
def test_no_two_safe_colours_look_alike_to_any_reader(vision):
    assert _least_distance(DEFAULT_CLASSES.palette(safe=True), vision) > 13


def test_the_papers_colours_do_to_some():
    assert _least_distance(DEFAULT_CLASSES.palette(), "deutan") < 3


def test_the_style_holds_both_palettes():
    safe, paper = class_style(DEFAULT_CLASSES).split(":root[data-colours=paper]")
    assert "--class-1:#1c3353" in safe
    assert "--class-1:#804080" in paper
    assert [name for name, _ in class_legend(DEFAULT_CLASSES)] == [name.replace("_", " ") for name in CLASS_NAMES]
