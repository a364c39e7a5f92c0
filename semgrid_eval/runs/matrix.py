"""Experiment matrices: YAML files of rows, with defaults and axes, resolved into complete rows."""

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from semgrid_eval.config import Config, load_yaml, parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.models.flow import FlowConfig
from semgrid_eval.models.network import NetworkConfig
from semgrid_eval.models.predictor import installed_models
from semgrid_eval.models.training import TrainingConfig
from semgrid_eval.scores.evaluate import MaskMode
from semgrid_eval.scores.results import RowFacts
from semgrid_eval.windows.plan import WindowConfig

TRAINED_MODEL = "ed"
BASELINES = {
    "newest": "newest input",
    "overlay": "newest input of one sensor drawn over the other's",
    "fuse": "all inputs overlaid, newest known cell wins",
    "table": "likeliest class given the inputs' classes in the cell, counted on the training windows",
    "flow": "all inputs overlaid, what is seen moving between the newest two moved on",
}
ROW_LIMIT = 10_000
_ENDS = ("upper", "lower")


def _target_sensors(known: dict[str, Any]) -> tuple[str, ...]:
    """Return the sensors of the target of a row's grid, none where that is at fault itself."""
    return known["grid"].target if "grid" in known else ()


class Row(Config):
    """One experiment with everything that determines it.

    Args:
        name: unique in the matrix, like `ED-Sp2`; axes fill in `{key}` places.
        experiment: the group in which a report compares rows; the name without `BL-` or `ED-` if not given.
        model: `ed`, a baseline (`newest`, `overlay`, `fuse`, `table`, `flow`), `path.py:Class` of one's own, or the
            name of an installed one.
        sensors: inputs, from the grid config's sensors; those of its target if not given.
        translate: whether inputs are moved to the target's time (T2); the paper's NT rows do not.
        mask_mode: what becomes of the mask M in scores (reading 9).
        overlay: which sensor the `overlay` baseline draws last (reading 20).
        flow: what the `flow` baseline takes as evidence of motion.
        repeats: trainings with different seeds.
        validation_window: where it differs from `window`, for recordings of another frame rate; what a file leaves out
            is as in `window`, and the number of inputs has to be.
    """

    name: str = Field(min_length=1, max_length=200)
    experiment: str = ""
    model: str
    grid: GridConfig = GridConfig()
    sensors: tuple[str, ...] = Field(default_factory=_target_sensors, min_length=1)
    translate: bool = True
    mask_mode: MaskMode = "exclude"
    overlay: Literal["upper", "lower"] = "upper"
    flow: FlowConfig = FlowConfig()
    repeats: int = Field(1, ge=1, le=1000)
    train_split: str = "train"
    validation_split: str = "val"
    window: WindowConfig = WindowConfig()
    validation_window: WindowConfig | None = None
    network: NetworkConfig = NetworkConfig()
    training: TrainingConfig = TrainingConfig()

    @model_validator(mode="after")
    def _sound(self) -> Self:
        for sensor in self.sensors:
            if sensor not in self.grid.sensors:
                raise ValueError(f"sensor {sensor!r} is not one of {', '.join(self.grid.sensors)}")
        if not self.built_in and ":" not in self.model and self.model not in (installed := installed_models()):
            models = ", ".join((TRAINED_MODEL, *BASELINES, *installed))
            raise ValueError(f"model {self.model!r} is not one of {models} or path.py:Class")
        if self.scored_window.inputs != self.window.inputs:
            raise ValueError(f"validation_window has {self.scored_window.inputs} inputs, window {self.window.inputs}")
        if self.model == "overlay" and any(sum(end in name for name in self.sensors) != 1 for end in _ENDS):
            raise ValueError("overlay needs two sensors, one with 'upper' and one with 'lower' in its name")
        return self

    @property
    def trained(self) -> bool:
        """Whether the row has weights to learn."""
        return self.model == TRAINED_MODEL

    @property
    def built_in(self) -> bool:
        """Whether the row's model comes with this package."""
        return self.trained or self.model in BASELINES

    @property
    def group(self) -> str:
        """The experiment that the row belongs to."""
        return self.experiment or self.name.removeprefix("BL-").removeprefix("ED-")

    @property
    def scored_window(self) -> WindowConfig:
        """Windows that are scored."""
        return self.validation_window or self.window

    @property
    def kind(self) -> str:
        """Kind of model: `ED`, `BL`, or whatever stands before the first hyphen of the name of one's own."""
        if self.trained:
            return "ED"
        return "BL" if self.model in BASELINES else self.name.partition("-")[0]

    @property
    def facts(self) -> RowFacts:
        """What the row is, whatever it is called."""
        return RowFacts(
            model=self.model,
            family=self.kind,
            learns=self.trained or self.model == "table",
            baseline=self.model in BASELINES,
            inputs=self.window.inputs,
            step_frames=self.scored_window.step_frames,
            horizon_steps=self.scored_window.horizon_steps,
            sensors=self.sensors,
            translate=self.translate,
        )

    @property
    def label(self) -> str:
        """Name and, in words, what the row does; the horizon is always said (reading 2)."""
        what = {"ed": f"encoder-decoder d {self.network.depth}, f {self.network.features}", **BASELINES}
        horizon = self.scored_window.horizon_steps
        parts = [
            what.get(self.model, self.model),
            "moved to the target's time" if self.translate else "not moved",
            f"{self.window.inputs} inputs",
            f"{horizon} step{'s' if horizon > 1 else ''} of {self.scored_window.step_frames} frames ahead",
        ]
        return f"{self.name} ({', '.join(parts)})"


class Matrix(Config):
    """A resolved matrix: every row complete."""

    title: str
    seed: int = Field(ge=0)
    rows: tuple[Row, ...] = Field(min_length=1)


class _Axes(Config):
    grid: dict[str, list[Any]] = Field(default_factory=dict)
    zip: dict[str, list[Any]] = Field(default_factory=dict)


class _MatrixFile(Config):
    """What a matrix file may hold.

    Args:
        extends: a preset, or a file beside this one, whose rows, defaults and seed this one starts from. Defaults are
            merged key by key; so is a row into the base's row of the same written name; other rows come after those.
        without: written names of the base's rows to leave out.
        title: the name of the file if not given, also where it extends another.
    """

    extends: str | None = None
    without: list[str] = Field(default_factory=list)
    title: str = Field("", max_length=200)
    seed: int | None = Field(None, ge=0)
    defaults: dict[str, Any] = Field(default_factory=dict)
    rows: list[dict[str, Any]] = Field(default_factory=list)


def preset_names() -> list[str]:
    """List the matrices that come with the package."""
    files = resources.files("semgrid_eval.presets").iterdir()
    return sorted(file.name.removesuffix(".yaml") for file in files if file.name.endswith(".yaml"))


def load_matrix(name_or_path: str, *, models: Sequence[str] = ()) -> Matrix:
    """Read a matrix file, or a preset by its name, and add a row for each of `models`, named after its class.

    Raises:
        ConfigError: names file, row and key at fault.
    """
    file, path = _read(name_or_path)
    added = [{"name": model.rpartition(":")[2], "model": model} for model in models]
    return _resolve(file.model_copy(update={"rows": [*file.rows, *added]}), path)


def _read(name: str, *above: Path) -> tuple[_MatrixFile, Path]:
    """Read a preset or a file with all that it extends; `above` are the files that extend it, the nearest last."""
    path, value = _load(name, *above)
    file = parse_config(_MatrixFile, value, path=path)
    if file.extends is None:
        if file.without:
            raise ConfigError("names rows of a base, and there is no `extends`", path=path, field="without")
        return file, path
    if path.resolve() in [other.resolve() for other in above]:
        raise ConfigError(f"{file.extends!r} leads back to this file", path=path, field="extends")
    base, base_path = _read(file.extends, *above, path)
    _resolve(base, base_path)  # a fault of the base is named as such
    return _extended(base, file, path), path


def _load(name: str, *above: Path) -> tuple[Path, object]:
    if name in preset_names():
        with resources.as_file(resources.files("semgrid_eval.presets") / f"{name}.yaml") as place:
            return Path(f"preset {name}"), load_yaml(place)
    path = above[-1].parent / name if above else Path(name)
    if path.is_file():
        return path, load_yaml(path)
    fault = f"is neither a file nor a preset ({', '.join(preset_names())})"
    if above:
        raise ConfigError(f"{path} {fault}", path=above[-1], field="extends")
    raise ConfigError(fault, path=path)


def _extended(base: _MatrixFile, file: _MatrixFile, path: Path) -> _MatrixFile:
    """Put a file over the one that it extends."""
    names = [_written_name(row) for row in base.rows]
    for name in file.without:
        if name not in names:
            raise ConfigError(
                f"{name!r} is not a row of {file.extends}: {', '.join(names)}", path=path, field="without"
            )
    rows = [row for name, row in zip(names, base.rows, strict=True) if name not in file.without]
    unchanged = {_written_name(row): place for place, row in enumerate(rows)}
    for row in file.rows:
        # A row is changed once; written again it is a new one, whose name is taken.
        place = unchanged.pop(_written_name(row), None)
        if place is None:
            rows.append(row)
        else:
            rows[place] = _merge(rows[place], row)
    seed = base.seed if file.seed is None else file.seed
    return _MatrixFile(title=file.title, seed=seed, defaults=_merge(base.defaults, file.defaults), rows=rows)


def _written_name(row: dict[str, Any]) -> str:
    """Return a row's name before axes fill it in."""
    return str(row.get("name", ""))


def _resolve(file: _MatrixFile, path: Path) -> Matrix:
    rows = [parse_config(Row, row, path=f"{path}: {place}") for place, row in _expanded(file, path)]
    if not rows:
        raise ConfigError("there is no row", path=path, field="rows")
    name, count = Counter(row.name for row in rows).most_common(1)[0]
    if count > 1:
        raise ConfigError(f"{name!r} is the name of {count} rows", path=path, field="rows.name")
    return Matrix(title=file.title or path.stem, seed=file.seed or 0, rows=tuple(rows))


def _expanded(file: _MatrixFile, path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Merge defaults into each row and multiply it by its axes."""
    number = 0
    for row in file.rows:
        place = f"row {row.get('name', '?')!r}"
        merged = _merge(file.defaults, row)
        axes = parse_config(_Axes, merged.pop("axes", {}), path=f"{path}: {place}.axes")
        for values in _combinations(axes, f"{path}: {place}"):
            number += 1
            if number > ROW_LIMIT:
                raise ConfigError(f"gives more than {ROW_LIMIT} rows", path=path, field="axes")
            filled = _fill(merged, values, f"{path}: {place}")
            window, scored = filled.get("window", {}), filled.get("validation_window")
            if isinstance(window, dict) and isinstance(scored, dict):
                filled["validation_window"] = _merge(window, scored)
            yield place, filled


def _combinations(axes: _Axes, place: str) -> Iterator[dict[str, Any]]:
    lengths = {len(values) for values in axes.zip.values()}
    if len(lengths) > 1:
        raise ConfigError(f"lists of {' and '.join(map(str, sorted(lengths)))} values", path=place, field="axes.zip")
    together = [dict(zip(axes.zip, values, strict=True)) for values in zip(*axes.zip.values(), strict=True)] or [{}]
    for values in itertools.product(*axes.grid.values()):
        for zipped in together:
            yield {**dict(zip(axes.grid, values, strict=True)), **zipped}


def _fill(row: dict[str, Any], values: dict[str, Any], place: str) -> dict[str, Any]:
    for key, value in values.items():
        nested: Any = value
        for part in reversed(key.split(".")):
            nested = {part: nested}
        row = _merge(row, nested)
    name = _written_name(row)
    for key, value in values.items():
        name = name.replace("{" + key + "}", str(value))
    if "{" in name:
        raise ConfigError(f"{name!r} has a place that no axis fills", path=place, field="name")
    return {**row, "name": name}


def _merge(base: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Put `change` over `base`, mapping by mapping."""
    merged = dict(base)
    for key, value in change.items():
        old = merged.get(key)
        merged[key] = _merge(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return merged
