"""What a training leaves in its folder: a checkpoint while it lasts, its history, and in the end the weights."""

import csv
import io
import json
import pickle
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file, write_text
from semgrid_eval.models.network import Network

WEIGHTS_FILE = "weights.safetensors"
HISTORY_FILE = "history.csv"
CHECKPOINT_FILE = "checkpoint.pt"
_HEADER = "semgrid_eval"


class EpochRecord(NamedTuple):
    """One row of the history; losses are masked means, `seconds` the epoch's own time without validation."""

    epoch: int  # counted from 1
    updates: int
    learning_rate: float
    loss: float
    validation_loss: float | None
    seconds: float


class TrainingFolder:
    """The folder of one training, which `key` tells from every other.

    Reading raises an `InputError` where a file is damaged, missing or another training's.
    """

    def __init__(self, path: Path, key: str) -> None:
        self._path, self._key, self._checkpoint = path, key, path / CHECKPOINT_FILE

    def is_complete(self) -> bool:
        """Tell whether the training was finished."""
        weights = self._path / WEIGHTS_FILE
        if not weights.is_file():
            return False
        self._check_key(read_header(weights).get("training"), weights)
        return True

    def read(self, network: Network) -> list[EpochRecord]:
        """Load the weights of a finished training into the network and return its history."""
        self._checkpoint.unlink(missing_ok=True)  # a stop between the weights and this leaves it
        load_weights(network, self._path / WEIGHTS_FILE)
        return read_history(self._path / HISTORY_FILE)

    def restore(self, network: Network, optimizer: torch.optim.Optimizer) -> list[EpochRecord]:
        """Load the checkpoint into network and optimizer and return the history so far, empty where there is none."""
        if not self._checkpoint.is_file():
            return []
        device = next(network.parameters()).device
        try:
            state: dict[str, Any] = torch.load(self._checkpoint, map_location=device, weights_only=True)
            self._check_key(state["key"], self._checkpoint)
            network.load_state_dict(state["network"])
            optimizer.load_state_dict(state["optimizer"])
            return [EpochRecord(*row) for row in state["history"]]
        except (OSError, RuntimeError, ValueError, KeyError, TypeError, EOFError, pickle.UnpicklingError) as error:
            raise InputError(
                f"is damaged; delete it to train again from the start ({error})", path=self._checkpoint
            ) from error

    def keep(self, network: Network, optimizer: torch.optim.Optimizer, history: Sequence[EpochRecord]) -> None:
        """Write the checkpoint, then the history: a stop loses nothing that was kept before."""
        state = {
            "key": self._key,
            "network": network.state_dict(),
            "optimizer": optimizer.state_dict(),
            "history": [tuple(row) for row in history],
        }
        with atomic_file(self._checkpoint) as stream:
            torch.save(state, stream)
        write_history(self._path / HISTORY_FILE, history)

    def finish(self, network: Network, history: Sequence[EpochRecord]) -> None:
        """Write history and weights and remove the checkpoint."""
        write_history(self._path / HISTORY_FILE, history)
        save_weights(network, self._path / WEIGHTS_FILE, training=self._key)
        self._checkpoint.unlink(missing_ok=True)

    def _check_key(self, found: object, path: Path) -> None:
        if found != self._key:
            raise InputError(f"belongs to another training ({found}, not {self._key})", path=path)


def save_weights(network: Network, path: Path, **notes: str) -> None:
    """Write weights as safetensors; the header says of what model they are, with which settings, and `notes`."""
    header = {
        "model": type(network).__name__,
        "settings": network.settings.model_dump(mode="json"),
        "given": asdict(network.given),
        **notes,
    }
    # Layers may share weights, which safetensors refuses to write.
    tensors = {name: value.detach().cpu().contiguous().clone() for name, value in network.state_dict().items()}
    # One entry, because safetensors writes several in an order that changes from time to time.
    content = save(tensors, metadata={_HEADER: json.dumps(header, sort_keys=True)})
    with atomic_file(path) as stream:
        stream.write(content)


def load_weights(network: Network, path: Path) -> None:
    """Load weights that `save_weights` wrote into a network of the same build; an `InputError` says what is wrong."""
    read_header(path)
    try:
        with safe_open(path, framework="pt") as archive:
            network.load_state_dict({name: archive.get_tensor(name) for name in archive.keys()})  # noqa: SIM118
    except (KeyError, TypeError, RuntimeError) as error:
        raise InputError(f"has no weights of this network: {error}", path=path) from error


def read_header(path: Path) -> dict[str, Any]:
    """Read what `save_weights` wrote beside the weights.

    Raises:
        InputError: the file is missing, damaged or not of this kind.
    """
    try:
        with safe_open(path, framework="pt") as archive:
            return dict(json.loads((archive.metadata() or {})[_HEADER]))
    except (OSError, SafetensorError) as error:
        raise InputError(f"cannot be read: {error}", path=path) from error
    except (KeyError, TypeError, ValueError):
        raise InputError("holds no network of this version", path=path) from None


def write_history(path: Path, history: Sequence[EpochRecord]) -> None:
    """Write the history as CSV; a validation loss that was not asked for is empty."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(EpochRecord._fields)
    writer.writerows(history)
    write_text(path, buffer.getvalue())


def read_history(path: Path) -> list[EpochRecord]:
    """Read a history.

    Raises:
        InputError: it is missing or damaged.
    """
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
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
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise InputError(f"is not a history of a training: {error}", path=path) from error
