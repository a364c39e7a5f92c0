"""A segmentation network in an ONNX file: checked when it is opened, then images in and label ids out."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CITYSCAPES_LABELS, label_ids_from_train_ids
from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.executors import available_cores
from semgrid_eval.recording.png import MAX_PIXELS
from semgrid_eval.segmentation.config import SegmentationConfig

Size = tuple[int, int]
"""Width and height in pixels."""
_VOID = 255
_OF_THE_RUNTIME = re.compile(r"\[ONNXRuntimeError\] : \d+ : \w+ : |Load model from .* failed: ?")
_MESSAGE_CHARACTERS = 200
Shape = Sequence[int | str | None]
"""Of a tensor; axes that the model leaves open have a name, or None."""


def network_input(
    picture: NDArray[np.uint8], size: Size, mean: Sequence[float], std: Sequence[float]
) -> NDArray[np.float32]:
    """Scale an RGB picture to a size (bilinear) and normalise it: (H, W, 3) -> (1, 3, h, w)."""
    if size != size_of(picture):
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), np.uint8)
    levels = np.arange(256) / 255
    result = np.empty((1, 3, *picture.shape[:2]), np.float32)
    for channel in range(3):
        table = ((levels - mean[channel]) / std[channel]).astype(np.float32)
        np.take(table, picture[..., channel], out=result[0, channel])
    return result


def best_class(scores: NDArray[np.floating], size: Size, *, smooth: bool) -> NDArray[np.uint8]:
    """Resize scores and take the class of the highest, the first of equal ones: (C, h, w) -> (H, W).

    One class, of at most 256, is scaled at a time, so that the scores of all at full size are never in memory. Smooth
    scores are interpolated (bilinear, by the centres of pixels); otherwise the nearest is taken.
    """
    smooth = smooth and size != size_of(scores[0])
    best = _plane(scores[0], size, smooth=smooth)
    ids = np.zeros(best.shape, np.uint8)
    for number in range(1, len(scores)):
        plane = _plane(scores[number], size, smooth=smooth)
        ids[plane > best] = number
        np.maximum(best, plane, out=best)
    return ids if smooth else nearest(ids, size)


def nearest(ids: NDArray[np.uint8], size: Size) -> NDArray[np.uint8]:
    """Resize ids, each from the pixel that holds its centre: (h, w) -> (H, W)."""
    if size == size_of(ids):
        return ids
    columns, rows = ((2 * np.arange(new) + 1) * old // (2 * new) for new, old in zip(size, size_of(ids), strict=True))
    return ids[rows[:, np.newaxis], columns]


def size_of(picture: NDArray[np.generic]) -> Size:
    """Return width and height of a picture (H, W, ...)."""
    return picture.shape[1], picture.shape[0]


def _plane(scores: NDArray[np.floating], size: Size, *, smooth: bool) -> NDArray[np.float32]:
    plane = np.array(scores, np.float32, order="C")
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR)) if smooth else plane


class _Tensor(NamedTuple):
    """One input or output of a model, as ONNX Runtime describes it."""

    name: str
    type: str
    shape: Shape


class SegmentationNetwork:
    """Labels colour images, on so many threads; by default on those that OMP_NUM_THREADS names, else on all cores.

    Raises:
        MissingExtraError: ONNX Runtime is not installed.
        InputError: the file is not an ONNX model, or does not turn one image into classes as the config says.
    """

    def __init__(self, path: Path, config: SegmentationConfig, *, threads: int | None = None) -> None:
        self._path, self._config = path, config
        self._classes, self._label_ids = _classes(label_ids=config.label_ids)
        self._session = _open(path, threads or _threads())
        self._input = self._only_input()
        self._open_width, self._open_height = self._sides()
        self._output = self._chosen_output()
        if self._output.shape:  # a model may leave even the number of axes open
            self._check_answer(self._output.shape, _kind(self._output.type))

    def label(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Name every pixel of an RGB picture: (H, W, 3) -> (H, W) Cityscapes label ids.

        Raises:
            InputError: the network fails or gives something else than classes; the message names file and output.
        """
        size = size_of(picture)
        config = self._config
        image = network_input(picture, self._network_size(size), config.mean, config.std)
        answer = self._run(image if config.layout == "nchw" else image.transpose(0, 2, 3, 1))
        self._check_answer(answer.shape, _kind(answer.dtype.name))
        if answer.ndim == 4:
            ids = best_class(self._scores(answer), size, smooth=config.upsample == "bilinear")
            return self._label_ids[ids]
        return nearest(self._label_ids[self._checked_ids(answer[0])], size)

    def _run(self, image: NDArray[np.float32]) -> NDArray[Any]:
        try:
            (answer,) = self._session.run([self._output.name], {self._input.name: np.ascontiguousarray(image)})
        except Exception as error:  # ONNX Runtime's errors have no base of their own
            raise self._error(f"the network failed: {_one_line(error)}", self._input) from error
        return np.asarray(answer)

    def _scores(self, answer: NDArray[Any]) -> NDArray[Any]:
        scores: NDArray[Any] = answer[0] if self._config.layout == "nchw" else answer[0].transpose(2, 0, 1)
        if np.isnan(scores.max()):
            raise self._error("gives scores that are not a number", self._output)
        return scores

    def _checked_ids(self, ids: NDArray[np.integer]) -> NDArray[np.uint8]:
        wrong = ((ids < 0) | (ids >= self._classes)) & (ids != _VOID)
        if wrong.any():
            kind = "label" if self._config.label_ids else "train"
            raise self._error(f"gives the id {ids[wrong][0]}, which is not a {kind} id", self._output)
        return ids.astype(np.uint8)

    def _only_input(self) -> _Tensor:
        inputs = [_Tensor(item.name, item.type, item.shape) for item in self._session.get_inputs()]
        if len(inputs) != 1:
            names = ", ".join(item.name for item in inputs)
            raise InputError(f"there are {len(inputs)} ({names}); one image is needed", path=self._path, field="inputs")
        found = inputs[0]
        expected = (1, 3, "H", "W") if self._config.layout == "nchw" else (1, "H", "W", 3)
        agrees = len(found.shape) == 4 and all(
            not isinstance(given, int) or not isinstance(wanted, int) or given == wanted
            for given, wanted in zip(found.shape, expected, strict=True)
        )
        if found.type != "tensor(float)" or not agrees:
            wanted = ", ".join(map(str, expected))
            raise self._error(f"is {found.type} of shape {_shown(found.shape)}; float ({wanted}) is needed", found)
        return found

    def _sides(self) -> tuple[int | None, int | None]:
        """Return width and height of the network's image; None where that of the picture is to be taken."""
        height, width = self._input.shape[2:] if self._config.layout == "nchw" else self._input.shape[1:3]
        asked = self._config.size or (None, None)
        return self._side(width, asked[0], "width"), self._side(height, asked[1], "height")

    def _side(self, fixed: int | str | None, asked: int | None, name: str) -> int | None:
        if not isinstance(fixed, int):
            return asked
        if fixed < 1 or asked not in (None, fixed):
            raise self._error(f"its {name} is fixed to {fixed}; {asked or 'at least 1'} was expected", self._input)
        return fixed

    def _network_size(self, size: Size) -> Size:
        width, height = self._open_width or size[0], self._open_height or size[1]
        if width * height > MAX_PIXELS:
            raise self._error(f"an image of {width} x {height} has more than {MAX_PIXELS} pixels", self._input)
        return width, height

    def _chosen_output(self) -> _Tensor:
        outputs = {item.name: _Tensor(item.name, item.type, item.shape) for item in self._session.get_outputs()}
        name = self._config.output
        if name is None and len(outputs) == 1:
            return next(iter(outputs.values()))
        if name is None or name not in outputs:
            fault = "none is chosen" if name is None else f"there is no {name}"
            raise InputError(f"{fault}; there are: {', '.join(outputs)}", path=self._path, field="output")
        return outputs[name]

    def _check_answer(self, shape: Shape, kind: str) -> None:
        """Refuse what is neither scores, 4 axes, nor ids, 3 axes; open axes are checked when they are known."""
        if (len(shape), kind) not in ((4, "float"), (3, "integer")):
            message = f"is {kind} of shape {_shown(shape)}; float scores with 4 axes or integer ids with 3 are needed"
            raise self._error(message, self._output)
        if (isinstance(shape[0], int) and shape[0] != 1) or 0 in shape:
            raise self._error(f"has shape {_shown(shape)}; one answer for one image is needed", self._output)
        classes = shape[1 if self._config.layout == "nchw" else 3] if kind == "float" else None
        fewest = 2 if self._config.label_ids else self._classes
        if isinstance(classes, int) and not fewest <= classes <= self._classes:
            wanted = f"at most {self._classes} label ids" if self._config.label_ids else f"{self._classes} train ids"
            raise self._error(f"scores {classes} classes; {wanted} are needed", self._output)

    def _error(self, message: str, tensor: _Tensor) -> InputError:
        return InputError(message, path=self._path, field=tensor.name)


def _classes(*, label_ids: bool) -> tuple[int, NDArray[np.uint8]]:
    """Return how many classes there can be, and the table (256,) from class to label id."""
    if not label_ids:
        return sum(label.train_id != _VOID for label in CITYSCAPES_LABELS), label_ids_from_train_ids()
    table = np.arange(256, dtype=np.uint8)
    table[len(CITYSCAPES_LABELS) :] = 0  # void is unlabeled
    return len(CITYSCAPES_LABELS), table


def _open(path: Path, threads: int) -> Any:  # noqa: ANN401 - ONNX Runtime has no types
    try:
        import onnxruntime
    except ImportError:
        raise MissingExtraError("segment", "onnxruntime") from None
    if not path.is_file():
        raise InputError("is not a file", path=path, field="model")
    settings = onnxruntime.SessionOptions()
    settings.log_severity_level = 4  # what is wrong also comes as an exception
    settings.intra_op_num_threads = threads
    try:
        return onnxruntime.InferenceSession(path, settings, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's errors have no base of their own
        raise InputError(f"is not a model that can be used: {_one_line(error)}", path=path) from error


def _threads() -> int:
    """Return what OMP_NUM_THREADS says, by which executors share out the cores, else the number of cores."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return int(asked) if asked.isdecimal() and int(asked) > 0 else available_cores()


def _kind(number_type: str) -> str:
    """Return `float` or `integer` for ONNX's and numpy's names of such types, any other as it is."""
    if "float" in number_type or "double" in number_type:
        return "float"
    return "integer" if "int" in number_type else number_type


def _shown(shape: Shape) -> str:
    return f"({', '.join('?' if axis is None else str(axis) for axis in shape)})"


def _one_line(error: Exception) -> str:
    text = _OF_THE_RUNTIME.sub("", " ".join(str(error).split())).partition(" Name:")[0]
    return text if len(text) <= _MESSAGE_CHARACTERS else f"{text[: _MESSAGE_CHARACTERS - 3]}..."
