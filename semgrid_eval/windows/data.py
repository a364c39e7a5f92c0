"""Windows over grid data, and batches of them, moved (T2) and masked."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.errors import InputError
from semgrid_eval.files import DIGEST_CHARACTERS
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs
from semgrid_eval.windows.grids import GridData, covered_without_truth, shift_grids, shift_in_cells
from semgrid_eval.windows.plan import Windows

Frames = NDArray[np.int32] | NDArray[np.int64]
"""Indices along F."""
_PART = 1 << 18  # windows that are looked at together, where all of them would take much memory


@dataclass(frozen=True)
class WindowBatch:
    """What a predictor sees of B windows, and what it is scored on."""

    past: Tensor  # (B, S, T, H, W) uint8 class ids, oldest first; in the target's place where the row translates
    sensors: tuple[str, ...]  # names along S
    shift_cells: Tensor  # (B, T, 2) int64 rows and columns by which ego motion moves each input into the target's place
    lead_s: Tensor  # (B, T) float32 time from each input to the target
    target: Tensor  # (B, H, W) uint8
    mask: Tensor  # (B, H, W) bool, M: seen in an aligned input, yet unknown in the target
    truth: Tensor | None = None  # (B, ...) what a model is told that says so by `Model.asks`; None for all others
    # (B, 2, H, W) uint8 class ids and their certainty, 255 = 1, of a model that says so by `Model.answers_in`.
    answers: Tensor | None = None

    def aligned(self, *, translate: bool) -> Tensor:
        """Return the inputs in the target's place (B, S, T, H, W), where they are already if the row translates."""
        return self.past if translate else shift_grids(self.past, self.shift_cells[:, None])


class Answers(Protocol):
    """Answers that were made elsewhere, read when they are asked for."""

    def __getitem__(self, chosen: Tensor | slice, /) -> Tensor:
        """Return class ids and their certainty, 255 = 1, of the chosen windows: (B, 2, H, W) uint8."""


@dataclass(frozen=True)
class Disturb:
    """How the inputs of windows are disturbed, and the extent of their grids."""

    how: Disturbance
    spec: GridSpec

    def __call__(self, windows: "WindowSet", chosen: Tensor | slice, grids: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Disturb the grids (B, S, T, H, W) of chosen windows: -> grids, shift (B, T, 2) and lead (B, T)."""
        inputs = Inputs(
            data=windows.data,
            spec=self.spec,
            sensor_rows=windows.sensor_rows,
            frames=windows.inputs[chosen].long().cpu().numpy(),
            target_frames=windows.target_frames[chosen].long().cpu().numpy(),
            grids=grids,
            shift_cells=windows.shift_cells[chosen].long(),
            lead_s=windows.lead_s[chosen],
        )
        found = self.how.apply(inputs)
        return found.grids, found.shift_cells, found.lead_s


@dataclass(frozen=True)
class WindowSet:
    """N windows over grid data; frames are indices along F."""

    data: GridData
    sensors: tuple[str, ...]
    sensor_rows: Tensor  # (S,) int64 where the input sensors lie in the data
    translate: bool  # whether inputs are moved into the target's place
    inputs: Tensor  # (N, T) int32: there may be millions of windows
    target_frames: Tensor  # (N,) int32
    shift_cells: Tensor  # (N, T, 2) int32
    lead_s: Tensor  # (N, T) float32
    disturb: Disturb | None = None  # what is wrong with the inputs that a model sees; M and targets never change
    truth: Tensor | None = None  # (N, ...) what of the truth is told; nothing but for a model that asks
    answers: Answers | None = None  # of a model that runs elsewhere

    def __len__(self) -> int:
        return len(self.target_frames)

    def to(self, device: torch.device) -> "WindowSet":
        """Return the same windows with all tensors on another device."""
        tensors = ("sensor_rows", "inputs", "target_frames", "shift_cells", "lead_s")
        moved = {name: getattr(self, name).to(device) for name in tensors}
        truth = None if self.truth is None else self.truth.to(device)
        return replace(self, data=self.data.to(device), truth=truth, **moved)

    def batch(self, chosen: Tensor | slice) -> WindowBatch:
        """Gather the chosen windows: (B,) int64 or a slice."""
        shift_cells, lead_s = self.shift_cells[chosen].long(), self.lead_s[chosen]
        seen = self.data.grids[self.sensor_rows[None, :, None], self.inputs[chosen][:, None, :].long()]
        aligned = shift_grids(seen, shift_cells[:, None])
        target = self.data.grids[self.data.sensor_index(self.data.target), self.target_frames[chosen].long()]
        mask = covered_without_truth(aligned, target)
        if self.disturb:
            seen, shift_cells, lead_s = self.disturb(self, chosen, seen)
            aligned = shift_grids(seen, shift_cells[:, None])
        return WindowBatch(
            past=aligned if self.translate else seen,
            sensors=self.sensors,
            shift_cells=shift_cells,
            lead_s=lead_s,
            target=target,
            mask=mask,
            truth=None if self.truth is None else self.truth[chosen],
            answers=None if self.answers is None else self.answers[chosen],
        )

    def disturbed(self, how: Disturbance | None, spec: GridSpec) -> "WindowSet":
        """Return the same windows with inputs that are wrong in some way, or right where none is given."""
        if how is None:
            return self if self.disturb is None else replace(self, disturb=None)
        return replace(self, disturb=Disturb(how, spec))

    def actors(self, chosen: slice) -> NDArray[np.uint8] | None:
        """Flag the cells near true actors, as `GridData.actors_near` does: -> (B, H, W)."""
        return self.data.actors_near(self.target_frames[chosen].cpu().numpy())

    def batches(self, size: int) -> Iterator[WindowBatch]:
        """Pass over all windows in order, `size` at a time."""
        for start in range(0, len(self), size):
            yield self.batch(slice(start, start + size))

    def digest(self) -> str:
        """Digest what determines every batch, given how logs become grids: logs, sensors, translation and frames."""
        total = hashlib.sha256(repr((self.data.digests, self.data.cell_m, self.sensors, self.translate)).encode())
        if self.disturb:
            total.update(self.disturb.how.model_dump_json().encode())
        for frames in (self.inputs, self.target_frames):
            total.update(repr(tuple(frames.shape)).encode())
            for part in torch.split(frames, _PART):
                total.update(part.cpu().numpy().astype(np.int64).tobytes())
        return total.hexdigest()[:DIGEST_CHARACTERS]


class Targets(NamedTuple):
    """What N windows are to predict: a frame along F, where the vehicle is, and when."""

    frames: Frames  # (N,) where a target lies between frames, one beside it
    position_m: NDArray[np.float64]  # (N, 2)
    stamps_ns: NDArray[np.int64]  # (N,)


def select_windows(data: GridData, windows: Windows, *, sensors: Sequence[str], translate: bool = True) -> WindowSet:
    """Resolve planned windows against grid data, input grids coming from `sensors`.

    Raises:
        InputError: there is no window, or a sensor does not exist.
    """
    if not len(windows):
        raise InputError("there are no windows")
    frames = windows.frames + data.first_frames.astype(np.int32)[windows.recording][:, None]
    parts = []
    for start in range(0, len(frames), _PART):
        inputs, target = frames[start : start + _PART, :-1], frames[start : start + _PART, -1]
        parts.append(_moves(data, inputs, Targets(target, data.position_m[target], data.stamps_ns[target])))
    moves = _Moves(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return _window_set(data, frames[:, :-1], frames[:, -1], moves, tuple(sensors), translate=translate)


def windows_at(
    data: GridData, inputs: Frames, at: Targets, *, sensors: Sequence[str], translate: bool = True
) -> WindowSet:
    """Resolve windows whose inputs (N, T) are frames along F, and whose targets may lie between frames."""
    return _window_set(data, inputs, at.frames, _moves(data, inputs, at), tuple(sensors), translate=translate)


class _Moves(NamedTuple):
    """How inputs come into their targets' places, and how long before them they were seen."""

    shift_cells: NDArray[np.int32]  # (N, T, 2)
    lead_s: NDArray[np.float32]  # (N, T)


def _moves(data: GridData, inputs: Frames, at: Targets) -> _Moves:
    moved_m = at.position_m[:, None] - data.position_m[inputs]
    lead_ns = at.stamps_ns[:, None] - data.stamps_ns[inputs]
    return _Moves(shift_in_cells(moved_m, data.cell_m).astype(np.int32), (lead_ns * 1e-9).astype(np.float32))


def _window_set(
    data: GridData, inputs: Frames, targets: Frames, moves: _Moves, sensors: tuple[str, ...], *, translate: bool
) -> WindowSet:
    def put(values: NDArray[np.number[Any]], kind: type[np.number[Any]]) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(values, kind)).to(data.device)

    return WindowSet(
        data=data,
        sensors=sensors,
        sensor_rows=torch.tensor([data.sensor_index(name) for name in sensors], device=data.device),
        translate=translate,
        inputs=put(inputs, np.int32),
        target_frames=put(targets, np.int32),
        shift_cells=put(moves.shift_cells, np.int32),
        lead_s=put(moves.lead_s, np.float32),
    )


def window_arrays(windows: WindowSet, *, batch: int = 64) -> dict[str, NDArray[np.uint8] | NDArray[np.bool_]]:
    """Return what a run keeps: aligned inputs (N, S, T, H, W), target, mask and, with the truth, actors (N, H, W)."""
    aligned = replace(windows, translate=True)
    parts = [(part.past.cpu(), part.target.cpu(), part.mask.cpu()) for part in aligned.batches(batch)]
    inputs, target, mask = (torch.cat(column).numpy() for column in zip(*parts, strict=True))
    actors = windows.actors(slice(None))
    return {"inputs": inputs, "target": target, "mask": mask, **({} if actors is None else {"actors": actors})}
