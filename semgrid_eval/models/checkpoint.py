"""What a training leaves in its folder, sealed: a checkpoint while it lasts, its history, in the end the weights."""

import csv
import io
import json
import logging
import pickle
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from semgrid_eval.errors import DamageError, InputError, ResultError
from semgrid_eval.models.network import Network
from semgrid_eval.seals import open_seal, read_sealed, write_sealed

WEIGHTS_FILE = "weights.safetensors"
HISTORY_FILE = "history.csv"
CHECKPOINT_FILE = "checkpoint.pt"
_HEADER = "semgrid_eval"
_log = logging.getLogger(__name__)


class EpochRecord(NamedTuple):
    """One row of the history; losses are masked means, `seconds` the epoch's own time without validation."""

    epoch: int  # counted from 1
    updates: int
    learning_rate: float
    loss: float
    validation_loss: float | None
    seconds: float


class TrainingFolder:
    """The folder of one training, which `key` tells from every other and which owns the seals of its files.

    What is damaged is made again, and a line says so; an `InputError` is raised where a file is another training's.
    """

    def __init__(self, path: Path, key: str) -> None:
        self._key, self._checkpoint = key, path / CHECKPOINT_FILE
        self._weights, self._history = path / WEIGHTS_FILE, path / HISTORY_FILE

    def is_complete(self) -> bool:
        """Tell whether the training was finished, and what it left is whole."""
        try:
            return self._was_finished()
        except DamageError:
            return False

    def read(self, network: Network) -> list[EpochRecord]:
        """Load the weights of a finished training into the network and return its history."""
        self._checkpoint.unlink(missing_ok=True)  # a stop between the weights and this leaves it
        load_weights(network, self._weights, owner=self._key)
        return read_history(self._history, owner=self._key)

    def restore(self, network: Network, optimizer: torch.optim.Optimizer) -> list[EpochRecord]:
        """Load the checkpoint into network and optimizer and return the history so far, empty where there is none."""
        try:
            self._was_finished()
        except DamageError as error:
            _log.warning("%s; the training is made again", error)
        if not self._checkpoint.is_file():
            return []
        try:
            content = read_sealed(self._checkpoint, self._key)
        except DamageError as error:
            _log.warning("%s; the training begins again", error)
            return []
        device = next(network.parameters()).device
        try:
            state: dict[str, Any] = torch.load(io.BytesIO(content), map_location=device, weights_only=True)
            network.load_state_dict(state["network"])
            optimizer.load_state_dict(state["optimizer"])
            return [EpochRecord(*row) for row in state["history"]]
        except (OSError, RuntimeError, ValueError, KeyError, TypeError, EOFError, pickle.UnpicklingError) as error:
            raise InputError(
                f"is not of this network; delete it to train again from the start ({error})", path=self._checkpoint
            ) from error

    def keep(self, network: Network, optimizer: torch.optim.Optimizer, history: Sequence[EpochRecord]) -> None:
        """Write the checkpoint, then the history: a stop loses nothing that was kept before."""
        content = io.BytesIO()
        state = {"network": network.state_dict(), "optimizer": optimizer.state_dict()}
        torch.save({**state, "history": [tuple(row) for row in history]}, content)
        content.write(open_seal(self._key).encode())  # behind the archive that PyTorch reads
        write_sealed(self._checkpoint, content.getvalue())
        write_history(self._history, history, owner=self._key)

    def finish(self, network: Network, history: Sequence[EpochRecord]) -> None:
        """Write history and weights and remove the checkpoint."""
        write_history(self._history, history, owner=self._key)
        save_weights(network, self._weights, owner=self._key)
        self._checkpoint.unlink(missing_ok=True)

    def _was_finished(self) -> bool:
        if not (self._weights.is_file() and self._history.is_file()):
            return False
        read_history(self._history, owner=self._key)  # small, and another training's is told by it
        read_header(self._weights, owner=self._key)
        return True


def find_finished(trainings: Path, key: str) -> Path | None:
    """Find the folder of a finished training by its key, whoever has trained it, and whatever the folder's name."""
    for folder in sorted(trainings.iterdir()) if trainings.is_dir() else ():
        with suppress(ResultError):  # another training's
            if TrainingFolder(folder, key).is_complete():
                return folder
    return None


def save_weights(
    network: Network, path: Path, *, owner: str = "", dtype: torch.dtype | None = None, **notes: str
) -> None:
    """Write weights as sealed safetensors; the header says of what model they are, with which settings, and `notes`.

    Those that are floating-point numbers are kept in `dtype`, if given.
    """
    header = {
        "model": type(network).__name__,
        "settings": network.settings.model_dump(mode="json"),
        "given": network.given.described(),
        "seal": open_seal(owner),
        **notes,
    }
    # Layers may share weights, which safetensors refuses to write.
    tensors = {name: value.detach().cpu().contiguous().clone() for name, value in network.state_dict().items()}
    if dtype is not None:
        tensors = {name: each.to(dtype) if each.is_floating_point() else each for name, each in tensors.items()}
    # One entry, because safetensors writes several in an order that changes from time to time.
    write_sealed(path, save(tensors, metadata={_HEADER: json.dumps(header, sort_keys=True)}))


def load_weights(network: Network, path: Path, *, owner: str | None = None) -> None:
    """Load weights that `save_weights` wrote into a network of the same build; an `InputError` says what is wrong."""
    content = read_sealed(path, owner)
    _header(content, path)
    try:
        network.load_state_dict(load(content))
    except (KeyError, TypeError, RuntimeError, SafetensorError) as error:
        raise InputError(f"has no weights of this network: {error}", path=path) from error


def read_header(path: Path, *, owner: str | None = None) -> dict[str, Any]:
    """Read what `save_weights` wrote beside the weights.

    Raises:
        ResultError: the file is missing, damaged, belongs to another `owner`, if given, or is not of this kind.
    """
    return _header(read_sealed(path, owner), path)


def _header(content: bytes, path: Path) -> dict[str, Any]:
    """Read the header of safetensors: its length in 8 bytes, then JSON."""
    try:
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
        return dict(json.loads(header["__metadata__"][_HEADER]))
    except (KeyError, TypeError, ValueError, RecursionError):
        raise DamageError("holds no network of this version", path=path) from None


def write_history(path: Path, history: Sequence[EpochRecord], *, owner: str = "") -> None:
    """Write the history as CSV, its seal a comment below; a validation loss that was not asked for is empty."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(EpochRecord._fields)
    writer.writerows(history)
    write_sealed(path, f"{buffer.getvalue()}# {open_seal(owner)}\n".encode())


def read_history(path: Path, *, owner: str | None = None) -> list[EpochRecord]:
    """Read a history.

    Raises:
        ResultError: it is missing, damaged or belongs to another `owner`, if given.
    """
    content = read_sealed(path, owner)
    try:
        lines = content.decode().splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        return [
            EpochRecord(
                epoch=int(row["epoch"]),
                updates=int(row["updates"]),
                learning_rate=float(row["learning_rate"]),
                loss=float(row["loss"]),
                validation_loss=float(row["validation_loss"]) if row["validation_loss"] else None,
                seconds=float(row["seconds"]),
            )
            for row in rows
        ]
    except (ValueError, KeyError, TypeError, csv.Error) as error:
        raise DamageError(f"is not a history of a training: {error}", path=path) from error
