"""A segmentation network in an ONNX file: checked when it is opened, then images in and label ids out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.recording.png import MAX_PIXELS
from semgrid_eval.recording.resizing import Size, nearest
from semgrid_eval.segmentation.class_maps import find_class_map, maps_of
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.pixels import best_class, network_input, size_of
from semgrid_eval.segmentation.session import open_model, words_of
from semgrid_eval.words import plural

_VOID = 255
Shape = Sequence[int | str | None]
"""Of a tensor; axes that the model leaves open have a name, or None."""
_INPUTS: dict[str, Shape] = {"nchw": (1, 3, "H", "W"), "nhwc": (1, "H", "W", 3)}
"""What an image has to look like, by layout."""


class _Tensor(NamedTuple):
    """One input or output of a model, as ONNX Runtime describes it."""

    name: str
    type: str
    shape: Shape


class SegmentationNetwork:
    """Labels colour images where `open_model` says; `device` is that place, `class_map` what its classes are.

    Raises:
        MissingExtraError: ONNX Runtime is not installed.
        ConfigError: there is no such device or class map.
        InputError: the file is not an ONNX model, or does not turn one image into classes as the config says.
    """

    def __init__(
        self, path: Path, config: SegmentationConfig, *, device: str = "auto", threads: int | None = None
    ) -> None:
        self._path, self._config = path, config
        self.class_map = find_class_map(config.classes)
        self._label_ids = self.class_map.table()
        self._session, self.device = open_model(path, device, threads)
        self._input, self._layout = self._only_input()
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
        answer = self._run(image if self._layout == "nchw" else image.transpose(0, 2, 3, 1))
        kind = _kind(answer.dtype.name)
        self._check_answer(answer.shape, kind)
        if kind == "float":
            ids = best_class(self._scores(answer), size, smooth=config.upsample == "bilinear")
            return self._label_ids[ids]
        ids = answer[0] if answer.ndim == 3 else answer[0].squeeze(self._class_axis - 1)
        return nearest(self._label_ids[self._checked_ids(ids)], size)

    def _run(self, image: NDArray[np.float32]) -> NDArray[Any]:
        try:
            (answer,) = self._session.run([self._output.name], {self._input.name: np.ascontiguousarray(image)})
        except Exception as error:  # ONNX Runtime's errors have no base of their own
            raise self._error(f"the network failed: {words_of(error)}", self._input) from error
        return np.asarray(answer)

    def _scores(self, answer: NDArray[Any]) -> NDArray[Any]:
        scores: NDArray[Any] = answer[0] if self._layout == "nchw" else answer[0].transpose(2, 0, 1)
        if np.isnan(scores.max()):
            raise self._error("gives scores that are not a number", self._output)
        return scores

    def _checked_ids(self, ids: NDArray[np.integer]) -> NDArray[np.uint8]:
        count = len(self.class_map.labels)
        wrong = ((ids < 0) | (ids >= count)) & (ids != _VOID)
        if wrong.any():
            fault = f"gives the id {ids[wrong][0]}, which is not one of the {count} classes of {self.class_map.name}"
            raise self._error(fault, self._output)
        return ids.astype(np.uint8)

    @property
    def _class_axis(self) -> int:
        return 1 if self._layout == "nchw" else 3

    def _only_input(self) -> tuple[_Tensor, str]:
        """Return the input for the image, and its layout."""
        inputs = [_Tensor(item.name, item.type, item.shape) for item in self._session.get_inputs()]
        if len(inputs) != 1:
            names = ", ".join(item.name for item in inputs)
            raise InputError(f"there are {len(inputs)} ({names}); one image is needed", path=self._path, field="inputs")
        found = inputs[0]
        layout = _layout(found.shape) if self._config.layout == "auto" else self._config.layout
        wanted = _INPUTS[layout]
        if found.type != "tensor(float)" or not _agrees(found.shape, wanted):
            raise self._error(
                f"is {found.type} of shape {_shown(found.shape)}; float {_shown(wanted)} is needed", found
            )
        return found, layout

    def _sides(self) -> tuple[int | None, int | None]:
        """Return width and height of the network's image; None where that of the picture is to be taken."""
        height, width = self._input.shape[2:] if self._layout == "nchw" else self._input.shape[1:3]
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
        """Refuse what is neither scores, 4 axes, nor ids, 3 axes or 4; open axes are checked when they are known."""
        classes = shape[self._class_axis] if len(shape) == 4 else None
        one_class = len(shape) == 4 and (classes == 1 or not isinstance(classes, int))
        if (len(shape), kind) not in ((4, "float"), (3, "integer")) and (kind, one_class) != ("integer", True):
            wanted = "float scores with 4 axes or integer ids with 3 are needed"
            raise self._error(f"is {kind} of shape {_shown(shape)}; {wanted}", self._output)
        if (isinstance(shape[0], int) and shape[0] != 1) or 0 in shape:
            raise self._error(f"has shape {_shown(shape)}; one answer for one image is needed", self._output)
        if kind == "float" and isinstance(classes, int):
            self._check_classes(classes)

    def _check_classes(self, count: int) -> None:
        known = self.class_map
        if not known.fewest <= count <= len(known.labels):
            others = "".join(f"; --classes {name} has so many" for name in maps_of(count))
            raise self._error(
                f"scores {plural(count, 'class', 'classes')}; {known.name} has {len(known.labels)}{others}",
                self._output,
            )

    def _error(self, message: str, tensor: _Tensor) -> InputError:
        return InputError(message, path=self._path, field=tensor.name)


def _kind(number_type: str) -> str:
    """Return `float` or `integer` for ONNX's and numpy's names of such types, any other as it is."""
    if "float" in number_type or "double" in number_type:
        return "float"
    return "integer" if "int" in number_type else number_type


def _layout(shape: Shape) -> str:
    """Return the layout of an image: channels come last where only the last axis is said to be 3."""
    return "nhwc" if len(shape) == 4 and shape[3] == 3 != shape[1] else "nchw"


def _agrees(shape: Shape, wanted: Shape) -> bool:
    """Whether axes that are numbers in both shapes are the same."""
    return len(shape) == len(wanted) and all(
        not isinstance(given, int) or not isinstance(needed, int) or given == needed
        for given, needed in zip(shape, wanted, strict=True)
    )


def _shown(shape: Shape) -> str:
    return f"({', '.join('?' if axis is None else str(axis) for axis in shape)})"
