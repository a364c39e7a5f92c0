"""What docs/labels.md shows: a SegFormer of random weights becomes an ONNX file, and labels; class maps are maps."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")

from support.commands import run_command
from support.onnx_models import colour_network
from support.pages import blocks, commands, text_of
from support.toy_world import street

from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.colour import decode_colour
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.segmentation.class_maps import NAMES, find_class_map
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.pixels import network_input

PAGE = text_of("docs/labels.md")
LINES = [line for line in commands(PAGE) if not line.startswith("pip ")]
# A SegFormer of five stages' least sizes; weights so far from zero that pixels get different classes.
MAKE = """
import sys
import numpy, torch
from transformers import SegformerConfig, SegformerForSemanticSegmentation

torch.manual_seed(3)
shape = {"hidden_sizes": [8, 16, 32, 64], "depths": [1, 1, 1, 1], "decoder_hidden_size": 32}
network = SegformerForSemanticSegmentation(SegformerConfig(num_labels=19, **shape)).eval()
with torch.no_grad():
    network.decode_head.classifier.weight.mul_(50)
network.save_pretrained("segformer")
with torch.inference_mode():
    scores = network(pixel_values=torch.from_numpy(numpy.load("image.npy"))).logits
    numpy.save("scores.npy", torch.nn.functional.interpolate(scores, (128, 256), mode="bilinear").numpy())
"""


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(street(1, frames=2).recording("toy"), Path("logs/val/toy.mcap"))
    Path("export.py").write_text(blocks("python", PAGE)[0])
    colour_network(Path("ade.onnx"), classes=150, colours={6: (0.0, 0.0, 0.0), 2: (1.0, 1.0, 1.0)})
    return tmp_path


def labels_of(folder):
    with LogReader(Path(folder, "val/toy.mcap")) as log:
        return [decode_gray(frame.label_png, bit_depth=8) for frame in log.frames("front")]


def run(line):
    program, *arguments = shlex.split(line)
    if program == "python":
        python("-W", "ignore", *arguments)
        return
    ended = run_command(arguments)
    assert ended.code == 0, f"{line}\n{ended.err}"


def python(*arguments):
    offline = {**os.environ, "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, *arguments], env=offline, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_segformer_of_random_weights_labels_a_log_as_torch_says(workplace):
    pytest.importorskip("transformers", reason="transformers, which makes the network, is not installed")
    with LogReader(Path("logs/val/toy.mcap")) as log:
        picture = decode_colour(next(log.frames("front", images=True)).image_file)
    config = SegmentationConfig()
    np.save("image.npy", network_input(picture, (1024, 512), config.mean, config.std))
    python("-W", "ignore", "-c", MAKE)
    assert [line.split()[:2] for line in LINES] == [
        ["python", "export.py"],
        *(["semgrid-eval", word] for word in ("segment", "check", "grids", "segment")),
    ]
    for line in LINES:
        run(line)
    scores = np.load("scores.npy")[0]
    numbers = {label: number for number, label in enumerate(find_class_map("cityscapes").table()[:19].tolist())}
    chosen = np.vectorize(numbers.get)(labels_of("labelled")[0])
    assert len(np.unique(chosen)) > 2
    highest = np.take_along_axis(scores, chosen[None], axis=0)[0]
    np.testing.assert_allclose(highest, scores.max(axis=0), atol=1e-3)  # equal but for the order of rounding
    assert {int(each) for label in labels_of("labelled-ade") for each in np.unique(label)} <= {7, 23}


def test_class_maps_of_the_page_are_maps(tmp_path):
    found = []
    for number, text in enumerate(blocks("yaml", PAGE)):
        (tmp_path / f"{number}.yaml").write_text(text)
        found.append(find_class_map(str(tmp_path / f"{number}.yaml")))
    assert found[0].labels == ("road", "sidewalk", "car", "person", "unlabeled")
    assert (found[1].classes[104], found[1].labels[9]) == ("fountain", "sidewalk")


def test_the_page_names_every_map_and_its_classes():
    table = dict(re.findall(r"^\| `([\w-]+)` \| (.+) \|$", PAGE[PAGE.index("| `cityscapes` |") :], re.MULTILINE))
    assert list(table) == list(NAMES)
    for name, words in table.items():
        assert str(len(find_class_map(name).labels)) in words
