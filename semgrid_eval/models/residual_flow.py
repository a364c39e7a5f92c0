"""RN-Flow: a residual network that also sees where BL-Flow moves what moves (not in the paper)."""

from dataclasses import replace

import torch
from pydantic import Field

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.flow import FlowSettings, MoveOn
from semgrid_eval.models.model import Given
from semgrid_eval.models.overlay import newest_first, overlay
from semgrid_eval.models.residual import Residual, ResidualSettings, require_what_moves
from semgrid_eval.windows.data import WindowBatch


class HintSettings(FlowSettings):
    """What counts as evidence of motion: less than BL-Flow asks for, since the network learns what it is worth."""

    least_motion_cells: float = Field(1.0, gt=0)
    size_ratio: float = Field(0.3, ge=0, le=1)
    overlap: float = Field(0.2, ge=0, le=1)
    seen: float = Field(0.2, ge=0, le=1)
    still_there: float = Field(0.6, ge=0, le=1)


class ResidualFlowSettings(ResidualSettings):
    """Settings of an RN-Flow: those of an RN, and what it is shown."""

    flow: HintSettings = HintSettings()  # what is shown to it


class ResidualFlow(Residual):
    """An RN with one more input, newer than all others: the cells in which BL-Flow's answer is not BL-Fuse's."""

    Settings = ResidualFlowSettings

    def __init__(self, settings: ResidualFlowSettings, given: Given) -> None:
        super().__init__(settings, replace(given, inputs=given.inputs + 1))
        self.given, self._flow = given, MoveOn(settings.flow, given)

    @classmethod
    def in_words(cls, settings: ResidualSettings) -> str:
        """Say what the model does."""
        return super().in_words(settings) + ", shown what moves on"

    @classmethod
    def check(cls, settings: ResidualSettings, given: Given) -> None:
        """Refuse a single input, and classes that do not move: nothing would be shown."""
        super().check(settings, given)
        if given.inputs < 2:
            raise ConfigError("motion is seen between two inputs, and there is one", field="window.inputs")
        require_what_moves(given.classes, "model")

    def shown(self, batch: WindowBatch) -> WindowBatch:
        """Append what moves on, as an input of the first sensor at the time of the newest."""
        shown = torch.full_like(batch.past[:, :, :1], UNKNOWN)  # (B, S, 1, H, W)
        if not batch.past.is_meta:  # where only shapes are asked for
            answer, still = self._flow.answer(batch), overlay(newest_first(batch))
            shown[:, 0, 0] = torch.where(answer == still, UNKNOWN, answer)
        return replace(
            batch,
            past=torch.cat([batch.past, shown], dim=2),
            shift_cells=torch.cat([batch.shift_cells, batch.shift_cells[:, -1:]], dim=1),
            lead_s=torch.cat([batch.lead_s, batch.lead_s[:, -1:]], dim=1),
        )
