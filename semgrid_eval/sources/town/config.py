"""What can be chosen of the simulated town; light to import."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from semgrid_eval.config import Config
from semgrid_eval.sources.benchmarks import RigName, SizeName, Stereo
from semgrid_eval.words import plural

CACHE = ".towns"
"""Folder of towns beside logs."""
FRAME_COUNT = 30
_STEREO = (
    "Errors of labels, disparity and motion: drawn from a model; or disparity from matching a rendered stereo pair; "
    "or none."
)
_ERRORS = (
    "Camera and strength of errors: the same in all recordings, or drawn for each; width and height then say how many "
    "pixels images have about."
)
_RIG = (
    "Sensors: a camera that looks ahead; with three more to the left, right and rear; a LiDAR on the roof beside "
    "either. All but the front camera have clocks of their own."
)
_VAL_TOWNS = "Towns for validation, if it is another share than of the recordings."
_TOWN_SIZE = "Side of the square that streets cover."
_FRAMES = "Of a recording, at 17 a second; 340 are 20 s."
_DURATION = "Simulated time of a town from which recordings are taken."
_POSITIONS_PER_KM2_S = 25_000
_MAX_POSITIONS = 10_000_000  # of everybody in a town at every step; they are held in memory, some 200 bytes each


class SyntheticConfig(Config):
    """What a synthetic data set is made of."""

    recordings: Annotated[int, Field(ge=1, le=100_000, description="How many.")]
    frames: Annotated[int, Field(ge=2, le=20_000, description=_FRAMES)] = FRAME_COUNT
    seed: Annotated[int, Field(ge=0, lt=1 << 31, description="The same seed gives the same bytes.")] = 0
    towns: Annotated[int, Field(ge=1, le=100, description="How many; each belongs to one split only.")] = 4
    val_share: Annotated[
        float, Field(ge=0.0, lt=1.0, description="Share of recordings, and of towns, for validation.")
    ] = 0.3
    val_towns: Annotated[int | None, Field(ge=1, description=_VAL_TOWNS)] = None
    town_size_m: Annotated[float, Field(ge=250.0, le=2000.0, description=_TOWN_SIZE)] = 450.0
    duration_s: Annotated[float, Field(ge=10.0, le=3600.0, description=_DURATION)] = 90.0
    width: Annotated[int, Field(ge=64, le=4096, description="Width of the images in pixels.")] = 512
    height: Annotated[int, Field(ge=32, le=2048, description="Height of the images in pixels.")] = 256
    stereo: Annotated[Stereo, Field(description=_STEREO)] = "modelled"
    rig: Annotated[RigName, Field(description=_RIG)] = "front"
    errors: Annotated[Literal["fixed", "varied"], Field(description=_ERRORS)] = "fixed"

    @model_validator(mode="after")
    def _splits_need_towns(self) -> Self:
        if self.val_share > 0.0 and self.towns < 2:
            raise ValueError("training and validation need different towns: ask for 2 towns or more, or val_share 0")
        if self.val_towns is not None and not (self.val_share > 0.0 and self.val_towns < self.towns):
            raise ValueError("val_towns must leave a town for training, and val_share recordings for validation")
        return self

    @model_validator(mode="after")
    def _drives_fit_in_time(self) -> Self:
        from semgrid_eval.sources.town.drives import needed_s  # here, as it is heavy

        if (longest_s := needed_s(self.frames)) > self.duration_s:
            least = f"a drive of {plural(self.frames, 'frame')} needs a town of {math.ceil(longest_s)} s or more"
            raise ValueError(f"{least}, not {self.duration_s:g} s: ask for a longer duration_s or fewer frames")
        return self

    @model_validator(mode="after")
    def _town_fits_in_memory(self) -> Self:
        positions = _POSITIONS_PER_KM2_S * (self.town_size_m / 1000.0) ** 2 * self.duration_s
        if positions > _MAX_POSITIONS:
            longest_s = int(self.duration_s * _MAX_POSITIONS / positions)
            most = f"a town of {self.town_size_m:g} m can be simulated for {longest_s} s at most"
            raise ValueError(f"{most}; ask for more towns")
        return self


class SizeOptions(Config):
    """Which size of a benchmark."""

    size: Annotated[SizeName, Field(description="Full is as large as the paper's data.")] = "small"


class NoOptions(Config):
    """Nothing can be chosen."""
