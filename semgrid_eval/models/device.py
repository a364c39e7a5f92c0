"""Where models run: device, precision, memory of the process and seeds."""

import ctypes
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Literal

import torch

from semgrid_eval.errors import ConfigError, first_line

Precision = Literal["auto", "float32", "bf16"]

_DEVICE_TYPES = ("cpu", "cuda", "mps")
_CPU_FILE = Path("/proc/cpuinfo")
_BF16_CAPABILITY = (8, 0)
_BF16_FLAGS = {"avx512_bf16", "amx_bf16"}
# Parameters of glibc's mallopt and values that make it keep and re-use its memory.
_MALLOPT = {-4: 0, -1: 2**31 - 1, -2: 256 << 20}  # M_MMAP_MAX, M_TRIM_THRESHOLD, M_TOP_PAD


def choose_device(name: str = "auto") -> torch.device:
    """Turn `auto` (CUDA where there is one, else CPU), `cpu`, `cuda`, `cuda:1` ... into a device.

    Raises:
        ConfigError: there is no such device here.
    """
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
        torch.empty(1, device=device)
    except (RuntimeError, AssertionError, ImportError):
        device = None
    if device is None or device.type not in _DEVICE_TYPES:
        raise ConfigError(f"there is no device {name!r} on this machine; use auto, cpu or cuda", field="device")
    return device


def choose_precision(name: Precision, device: torch.device) -> torch.dtype:
    """Turn `auto` into bfloat16 where the device multiplies in it natively, else float32.

    On two cores of an AMD EPYC with avx512_bf16, training in bfloat16 is 1.5 (f 16) to 1.9 times (f 64) as fast as in
    float32 (`semgrid-eval bench --only training`). A CPU without such instructions emulates them.
    """
    if device.type == "cuda":
        native = torch.cuda.get_device_capability(device) >= _BF16_CAPABILITY
    else:
        native = device.type == "cpu" and cpu_has_bf16()
    return torch.bfloat16 if name == "bf16" or (name == "auto" and native) else torch.float32


def visible_gpus() -> list[str]:
    """Name the GPUs that this process may use, as CUDA_VISIBLE_DEVICES does."""
    count = torch.cuda.device_count()
    listed = os.environ.get("CUDA_VISIBLE_DEVICES", "")
    return listed.split(",")[:count] if listed else [str(number) for number in range(count)]


@cache
def cpu_facts() -> dict[str, str]:
    """Read what the system says of its first processor, like `model name` and `flags`; empty where it does not."""
    try:
        text = _CPU_FILE.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return {}
    pairs = (line.partition(":") for line in text.partition("\n\n")[0].splitlines())
    return {name.strip(): value.strip() for name, _, value in pairs}


def cpu_has_bf16() -> bool:
    """Tell whether this CPU multiplies bfloat16 natively; False where the system does not say."""
    return not _BF16_FLAGS.isdisjoint(cpu_facts().get("flags", "").split())


def settle_process() -> None:
    """Set what holds for this whole process; whoever begins to train or score in one calls this first.

    CUDA's convolutions repeat their sums in the same order, and their float32 is no less. glibc keeps freed memory
    instead of giving each large tensor back to the system: page faults of fresh memory otherwise take up to half of
    the time of a training on a CPU.
    """
    torch.backends.cudnn.deterministic, torch.backends.cudnn.allow_tf32 = True, False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, TypeError, AttributeError):  # not glibc
        return
    for parameter, value in _MALLOPT.items():
        mallopt(parameter, value)


def memory_words(error: BaseException) -> str:
    """Say in one line what did not fit into memory."""
    asked = re.search(r"allocate (\d+) bytes", str(error))
    size = f"{int(asked[1]) / (1 << 30):.1f} GiB were asked for at once" if asked else first_line(error)
    return f"out of memory: {size}"


def is_out_of_memory(error: BaseException) -> bool:
    """Tell whether an error says that something does not fit into memory; on a CPU, torch has no type for it."""
    known = isinstance(error, (torch.OutOfMemoryError, MemoryError))
    return known or (isinstance(error, RuntimeError) and "allocate memory" in str(error))


@contextmanager
def seeded(seed: int, device: torch.device) -> Iterator[None]:
    """Seed torch's own generators of CPU and device inside the block and restore them after it."""
    with torch.random.fork_rng([device] if device.type == "cuda" else []):
        torch.default_generator.manual_seed(seed)
        if device.type == "cuda":
            with torch.cuda.device(device):
                torch.cuda.manual_seed(seed)
        yield
