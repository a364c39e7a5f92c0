"""An ONNX file, opened by ONNX Runtime on a CPU or a GPU."""

import os
import re
from pathlib import Path
from typing import Any, NamedTuple

from semgrid_eval.errors import ConfigError, InputError, MissingExtraError
from semgrid_eval.executors import available_cores

_OF_THE_RUNTIME = re.compile(r"\[ONNXRuntimeError\] : \d+ : \w+ : |Load model from .* failed: ?")
_MESSAGE_CHARACTERS = 200
_CPU, _CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"
_DEVICE = re.compile(r"auto|cpu|cuda(?::(\d{1,3}))?")


class Opened(NamedTuple):
    """A model that can run, and where it does: `cpu`, or `cuda:0`, the first GPU."""

    session: Any  # ONNX Runtime has no types
    device: str


def open_model(path: Path, device: str, threads: int | None = None) -> Opened:
    """Open a model on `auto` (the first GPU where ONNX Runtime can use it, else the CPU), `cpu`, `cuda` or `cuda:N`.

    On a CPU it works on so many threads; by default on those that OMP_NUM_THREADS names, else on all cores.

    Raises:
        MissingExtraError: ONNX Runtime is not installed.
        ConfigError: there is no such device, or this ONNX Runtime cannot use it.
        InputError: the file is not an ONNX model.
    """
    try:
        import onnxruntime
    except ImportError:
        raise MissingExtraError("segment", "onnxruntime") from None
    asked = _DEVICE.fullmatch(device)
    if asked is None:
        raise ConfigError(f"there is no device {device!r} for ONNX Runtime; use auto, cpu or cuda", field="device")
    number = asked[1] or "0"
    usable = device != "cpu" and _CUDA in onnxruntime.get_available_providers()
    session = _session(path, threads, _providers(number) if usable else [_CPU])
    found = f"cuda:{number}" if _CUDA in session.get_providers() else "cpu"  # what cannot be used is left out silently
    if device.startswith("cuda") and found == "cpu":
        fault = f"this ONNX Runtime cannot use {device!r}; install onnxruntime-gpu in its place, or use auto or cpu"
        raise ConfigError(fault, field="device")
    return Opened(session, found)


def _providers(number: str) -> list[Any]:
    """On a GPU, sums are made in the same order each time, and float32 is no less."""
    return [(_CUDA, {"device_id": number, "cudnn_conv_algo_search": "DEFAULT", "use_tf32": "0"}), _CPU]


def _session(path: Path, threads: int | None, providers: list[Any]) -> Any:  # noqa: ANN401
    import onnxruntime

    if not path.is_file():
        raise InputError("is not a file", path=path, field="model")
    settings = onnxruntime.SessionOptions()
    settings.log_severity_level = 4  # what is wrong also comes as an exception
    settings.intra_op_num_threads = threads or _threads()
    try:
        return onnxruntime.InferenceSession(path, settings, providers=providers)
    except Exception as error:  # ONNX Runtime's errors have no base of their own
        raise InputError(f"is not a model that can be used: {words_of(error)}", path=path) from error


def words_of(error: Exception) -> str:
    """Return what ONNX Runtime says in an error, in one line, without its codes."""
    text = _OF_THE_RUNTIME.sub("", " ".join(str(error).split())).partition(" Name:")[0]
    return text if len(text) <= _MESSAGE_CHARACTERS else f"{text[: _MESSAGE_CHARACTERS - 3]}..."


def _threads() -> int:
    """Return what OMP_NUM_THREADS says, by which executors share out the cores, else the number of cores."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return int(asked) if asked.isdecimal() and int(asked) > 0 else available_cores()
