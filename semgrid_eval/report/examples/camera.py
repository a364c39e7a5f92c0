"""What the camera saw of one window: small pictures, the sensors' parts of the image, and the ground that none sees."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from semgrid_eval.errors import InputError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.examples.blind import blind_cells, parts_of_shown
from semgrid_eval.report.examples.drawing import Picture, data_uri, hatch_png, label_picture
from semgrid_eval.scores.results import WindowRecord
from semgrid_eval.scores.thumbnails import LogPictures
from semgrid_eval.sensors.camera import CameraSensor


@dataclass(frozen=True)
class Crop:
    """A sensor's part of the camera image, in percent of its width and height."""

    name: str
    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True)
class View:
    """What is known of a window besides its grids."""

    window: WindowRecord
    kept: LogPictures | None  # of its log; None where that is nothing
    grid: GridConfig | None  # how its grids were made; None where the result does not tell
    sensors: tuple[str, ...]  # names of those of the inputs

    def photos(self, stamp_ns: int, moment: str) -> Iterator[Picture]:
        """Return the camera image and the segmentation of a time, as far as they were kept."""
        if self.kept is None or self.grid is None or stamp_ns not in self.kept.frames:
            return
        files = self.kept.frames[stamp_ns]
        if files.image:
            yield Picture("Camera", f"Camera image, {moment}", data_uri(files.image, "image/webp"), kind="camera")
        with suppress(InputError):  # there is none, or it is damaged
            title = "Segmentation"
            yield label_picture(title, f"{title}, {moment}", files.label, self.grid.class_by_label())

    def before(self, stamp_ns: int) -> str:
        """Tell how long before the target a time is."""
        return f"{(self.window.target_stamp_ns - stamp_ns) / 1e9:.3f} s before the target"

    @property
    def crops(self) -> tuple[Crop, ...]:
        """The parts of the shown image that the sensors see, none for the whole image."""
        if self.grid is None:
            return ()
        parts = parts_of_shown(self.grid)
        seen = (name for name in self.sensors if name in parts and not parts[name].is_whole_image)
        return tuple(_crop(name, parts[name]) for name in seen)

    @property
    def hatching(self) -> str:
        """A picture to lay over grids that marks the ground that no sensor of an input sees; empty if there is none."""
        if self.kept is None or self.grid is None:
            return ""
        cells = blind_cells(self.kept.track, self.grid, self.sensors, self.window)
        return data_uri(hatch_png(cells)) if cells is not None and cells.any() else ""


def _crop(name: str, part: CameraSensor) -> Crop:
    width, height = part.image_size_px
    top, bottom, left, right = part.crop_px
    across, down = 100 / width, 100 / height
    return Crop(name, left * across, top * down, (right - left) * across, (bottom - top) * down)
