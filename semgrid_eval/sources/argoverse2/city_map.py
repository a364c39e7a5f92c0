"""Drivable areas and crossings of a log's map archive, in the city frame."""

from pathlib import Path
from typing import Any

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_json
from semgrid_eval.recording.road_map import RoadMap

_ARCHIVE = "log_map_archive_*.json"


def find_archive(log: Path) -> Path:
    """Return the map archive of a log's folder."""
    found = sorted((log / "map").glob(_ARCHIVE))
    if len(found) != 1:
        raise InputError(f"holds {len(found)} files {_ARCHIVE}; one is needed", path=log / "map")
    return found[0]


def city_of(archive: Path) -> str:
    """Return the city that the name of an archive tells, such as `PIT`; empty where it tells none."""
    return archive.stem.partition("____")[2].partition("_")[0]


def read_map(archive: Path) -> RoadMap:
    """Read an archive."""
    content = read_json(archive)
    try:
        drivable = [_corners(area["area_boundary"]) for area in content["drivable_areas"].values()]
        crossings = [_crossing(each) for each in content["pedestrian_crossings"].values()]
        return RoadMap.from_json(RoadMap(tuple(drivable), tuple(crossings)).to_json())
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"is not a map of Argoverse: {type(error).__name__} {error}", path=archive) from error
    except ValueError as error:
        raise InputError(str(error), path=archive) from error


def _crossing(given: Any) -> tuple[tuple[float, float], ...]:  # noqa: ANN401 - anything that JSON can hold
    """Join the two edges of a crossing, which run the same way."""
    return _corners([*given["edge1"], *given["edge2"][::-1]])


def _corners(given: Any) -> tuple[tuple[float, float], ...]:  # noqa: ANN401
    return tuple((corner["x"], corner["y"]) for corner in given)
