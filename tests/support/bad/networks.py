"""Bad segmentation networks, and options of `segment` that do not fit them."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from onnx import NodeProto, TensorProto, ValueInfoProto, helper, numpy_helper
from support.bad.case import Bad, Kind
from support.driving import driving
from support.onnx_models import colour_network, save

from semgrid_eval.log.store import write_log

SEGMENT = "segment logs --model net.onnx --out out"
LATENCY = "latency logs --segment net.onnx --out latency.json --frames 1 --warm-up 0 --threads 1 --device cpu"
COLOURS = {0: (1.0, 0.0, 0.0), 13: (0.0, 0.0, 1.0)}
IMAGE = (1, 3, "h", "w")


def whole() -> None:
    """Write a log with a colour image in each frame, and a network of 19 classes."""
    picture = cv2.imencode(".png", np.zeros((16, 32, 3), np.uint8))[1].tobytes()
    _write(lambda frame: replace(frame, image_file=picture))
    colour_network(Path("net.onnx"), colours=COLOURS)
    Path("three.yaml").write_text("classes: {none: unlabeled, ground: road, thing: car}")


def _write(change: object) -> None:
    def moments() -> Iterable[object]:
        for moment in driving(frames=2, size=(32, 16)).moments():
            yield replace(moment, cameras={"front": change(moment.cameras["front"])})

    write_log(replace(driving(), moments=moments), Path("logs/a.mcap"))


def _tensor(name: str, shape: Iterable[int | str | None], kind: int = TensorProto.FLOAT) -> ValueInfoProto:
    return helper.make_tensor_value_info(name, kind, list(shape))


def _net(
    words: str, nodes: list[NodeProto], *tensors: list[ValueInfoProto], more: str = "", constants: tuple = ()
) -> Bad:
    return Bad(words, f"{SEGMENT}{more}", spoil=lambda: save(Path("net.onnx"), nodes, *tensors, constants))


def _same(name: str = "answer", source: str = "image") -> NodeProto:
    return helper.make_node("Identity", [source], [name])


def _colours(words: str, more: str = "", **options: object) -> Bad:
    return Bad(words, f"{SEGMENT}{more}", spoil=lambda: colour_network(Path("net.onnx"), colours=COLOURS, **options))


def _says(words: str, content: bytes) -> Bad:
    return Bad(words, SEGMENT, {"net.onnx": content})


def _given(words: str, more: str) -> Bad:
    return Bad(words, f"{SEGMENT} {more}")


def _map(words: str, text: str) -> Bad:
    return Bad(f"class map: {words}", f"{SEGMENT} --classes own.yaml", {"own.yaml": text.encode()})


MAPS = {
    "an unknown label": "classes: {street: rode, wheels: car}",
    "a label that is a number": "classes: {street: 7, wheels: 26}",
    "one class": "classes: {street: road}",
    "another number of classes": "classes: {street: road, wheels: car}",
    "an index that is missing": 'classes: {"0": road, "2": car}',
    "names beside indices": 'classes: {"0": road, wheels: car}',
    "an unknown base": "{base: kitti, classes: {street: road}}",
    "a class that the base does not have": "{base: ade20k, classes: {street: road}}",
    "an index beyond the base": '{base: cityscapes, classes: {"19": car}}',
    "no classes": "base: ade20k",
}
TWO = [helper.make_node("Add", ["left", "right"], ["answer"])]
SHAPE = numpy_helper.from_array(np.array([1, 3, 2, 2], np.int64), "shape")
NAN = [helper.make_node("Sub", ["image", "image"], ["zero"]), helper.make_node("Div", ["zero", "zero"], ["answer"])]
KIND = Kind(
    "Segmentation networks",
    f"The file `net.onnx` of `{SEGMENT}`, or options of that command.",
    whole,
    (
        _says("it is empty", b""),
        _says("it is a text", b"weights"),
        _says("it is a ZIP file, as torch writes it", b"PK\x03\x04" + bytes(60)),
        _net("two inputs", TWO, [_tensor("left", IMAGE), _tensor("right", IMAGE)], [_tensor("answer", IMAGE)]),
        _net(
            "two outputs, none of them chosen",
            [_same(), _same("aux")],
            [_tensor("image", IMAGE)],
            [_tensor("answer", IMAGE), _tensor("aux", IMAGE)],
        ),
        _given("an output that is not there", "--output scores"),
        _net(
            "an input of three axes", [_same()], [_tensor("image", (3, "h", "w"))], [_tensor("answer", (3, "h", "w"))]
        ),
        _net(
            "an input of one channel",
            [_same()],
            [_tensor("image", (1, 1, "h", "w"))],
            [_tensor("answer", (1, 1, "h", "w"))],
        ),
        _net(
            "an input of bytes",
            [_same()],
            [_tensor("image", IMAGE, TensorProto.UINT8)],
            [_tensor("answer", IMAGE, TensorProto.UINT8)],
        ),
        _colours("--layout nchw, and channels last", " --layout nchw", shape=(1, "h", "w", 3), nhwc=True),
        _given("--layout nhwc, and channels first", "--layout nhwc"),
        _colours("a fixed size and another --size", " --size 16 16", shape=(1, 3, 8, 4)),
        _colours("a fixed size of 0", shape=(1, 3, 0, 4)),
        _given("a size beyond all pictures", "--size 8192 8193"),
        _colours("18 classes", classes=18),
        _colours("20 classes", classes=20),
        _colours("150 classes, without --classes ade20k", classes=150),
        _colours("35 classes with --classes cityscapes-ids", " --classes cityscapes-ids", classes=35),
        _net(
            "scores of whole numbers",
            [helper.make_node("Cast", ["image"], ["answer"], to=TensorProto.INT64)],
            [_tensor("image", IMAGE)],
            [_tensor("answer", IMAGE, TensorProto.INT64)],
        ),
        _net(
            "an answer without size",
            [_same()],
            [_tensor("image", IMAGE)],
            [_tensor("answer", (None, None, None, None))],
        ),
        _net(
            "an answer for two images",
            [helper.make_node("Concat", ["image", "image"], ["answer"], axis=0)],
            [_tensor("image", IMAGE)],
            [_tensor("answer", (2, 3, "h", "w"))],
            more=" --classes three.yaml",
        ),
        Bad(
            "ids beyond the classes",
            SEGMENT,
            spoil=lambda: colour_network(Path("net.onnx"), classes=34, colours={26: (0.0, 0.0, 0.0)}, ids=np.int64),
        ),
        _net(
            "scores that are not a number",
            NAN,
            [_tensor("image", IMAGE)],
            [_tensor("answer", IMAGE)],
            more=" --classes three.yaml",
        ),
        _net(
            "it fails while it works",
            [helper.make_node("Reshape", ["image", "shape"], ["answer"])],
            [_tensor("image", IMAGE)],
            [_tensor("answer", (1, 3, 2, 2))],
            more=" --classes three.yaml",
            constants=(SHAPE,),
        ),
        *(_map(words, text) for words, text in MAPS.items()),
        _given("a class map that is not there", "--classes cityscape"),
        _given("--device cuda, where ONNX Runtime has none", "--device cuda"),
        _given("--device gpu", "--device gpu"),
        _given("--std 0", "--std 0 1 1"),
        _given("--mean that is not finite", "--mean nan 0 0"),
        _given("--size 0", "--size 0 4"),
        _given("--out in the folder of the logs", "--out logs/new"),
        Bad(
            "a log without colour images", SEGMENT, spoil=lambda: _write(lambda frame: replace(frame, image_file=None))
        ),
        Bad(
            "two logs of one name",
            "segment logs more --model net.onnx --out out",
            spoil=lambda: (Path("more").mkdir(), Path("more/a.mcap").write_bytes(Path("logs/a.mcap").read_bytes())),
        ),
        Bad("`latency --segment`: not ONNX", LATENCY, {"net.onnx": b"weights"}),
        Bad(
            "`latency --segment`: 18 classes",
            LATENCY,
            spoil=lambda: colour_network(Path("net.onnx"), colours=COLOURS, classes=18),
        ),
    ),
)
