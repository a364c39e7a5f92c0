"""Tiny ONNX models of segmentation networks, whose answers can be told by hand."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from semgrid_eval.labels import CITYSCAPES_LABELS
from semgrid_eval.segmentation.config import SegmentationConfig

OPSET, IR_VERSION = 17, 8  # old enough for every ONNX Runtime that is allowed
FLAT = {"mean": (0.0, 0.0, 0.0), "std": (1.0, 1.0, 1.0)}
"""Options with which a network sees colours in 0..1."""


def colour_network(
    path: Path,
    *,
    classes: int = 19,
    colours: dict[int, tuple[float, float, float]],
    shape: tuple[int | str, ...] = (1, 3, "h", "w"),
    stride: int = 1,
    ids: type | None = None,
    nhwc: bool = False,
) -> Path:
    """Write a 1 x 1 convolution whose highest score is that of the nearest colour (RGB in 0..1).

    Args:
        path: the file.
        classes: how many scores; those without colour are far below the others.
        colours: by class.
        shape: of the input.
        stride: of the convolution: scores have one pixel for so many.
        ids: give ids of this integer type instead of scores.
        nhwc: channels come last in the image and in the scores.
    """
    # -|x - c|^2 is highest where 2 c x - |c|^2 is.
    weight = np.zeros((classes, 3, 1, 1), np.float32)
    bias = np.full(classes, -1e6, np.float32)
    for number, colour in colours.items():
        weight[number, :, 0, 0] = 2 * np.array(colour)
        bias[number] = -np.sum(np.square(colour))
    constants = [numpy_helper.from_array(weight, "weight"), numpy_helper.from_array(bias, "bias")]
    nodes = [helper.make_node("Conv", ["planes", "weight", "bias"], ["scored"], strides=[stride, stride])]
    nodes.insert(
        0, _turned("image", "planes", [0, 3, 1, 2]) if nhwc else helper.make_node("Identity", ["image"], ["planes"])
    )
    kind, rank = TensorProto.FLOAT, 4
    if ids is not None:
        kind, rank = helper.np_dtype_to_tensor_dtype(np.dtype(ids)), 3
        nodes.append(helper.make_node("ArgMax", ["scored"], ["best"], axis=1, keepdims=0))
        nodes.append(helper.make_node("Cast", ["best"], ["answer"], to=kind))
    else:
        nodes.append(
            _turned("scored", "answer", [0, 2, 3, 1]) if nhwc else helper.make_node("Identity", ["scored"], ["answer"])
        )
    given = helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)
    answer = helper.make_tensor_value_info("answer", kind, [None] * rank)
    return save(path, nodes, [given], [answer], constants)


def toy_labeller(path: Path) -> Path:
    """Write a network that knows the colours by which the toy world paints its labels."""
    levels = {label.train_id: label.label_id * 7 / 255 for label in CITYSCAPES_LABELS if label.train_id < 19}
    config = SegmentationConfig()
    painted = {
        number: tuple((level - mean) / std for mean, std in zip(config.mean, config.std, strict=True))
        for number, level in levels.items()
    }
    return colour_network(path, colours=painted)


def save(path, nodes, inputs, outputs, constants=(), opset=OPSET):
    """Write a model of these parts."""
    graph = helper.make_graph(nodes, "network", inputs, outputs, list(constants))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=IR_VERSION)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString(deterministic=True))
    return path


def _turned(before: str, after: str, axes: list[int]) -> onnx.NodeProto:
    return helper.make_node("Transpose", [before], [after], perm=axes)
