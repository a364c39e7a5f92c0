"""Experiment matrices: YAML files of rows, with defaults and axes, resolved into complete rows."""

import itertools
import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import Field

from semgrid_eval.class_files import with_classes
from semgrid_eval.config import Config, load_yaml, merged, parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.faults import meant, not_one_of, shown
from semgrid_eval.models.beside import require_defined, require_python
from semgrid_eval.models.registry import is_named, model_names
from semgrid_eval.presets import preset_names
from semgrid_eval.runs.row import Row
from semgrid_eval.words import plural

ROW_LIMIT = 10_000
MAX_SEED = 1 << 53  # whoever reads JSON has whole numbers up to here


class Matrix(Config):
    """A resolved matrix: every row complete."""

    title: str
    seed: int = Field(ge=0, le=MAX_SEED)
    rows: tuple[Row, ...] = Field(min_length=1)


class _Axes(Config):
    grid: dict[str, list[Any]] = Field(default_factory=dict)
    zip: dict[str, list[Any]] = Field(default_factory=dict)


class _WithAxes(Config):
    axes: _Axes = _Axes()


class _MatrixFile(Config):
    """What a matrix file may hold."""

    # A preset, or a file beside this one, whose rows, defaults, models and seed this one starts from. Defaults and
    # models are merged key by key; so is a row into the base's row of the same written name; other rows come after
    # those.
    extends: str | None = None
    without: list[str] = Field(default_factory=list)  # written names of the base's rows to leave out
    title: str = Field("", max_length=200)  # the name of the file if not given, also where it extends another
    seed: int | None = Field(None, ge=0, le=MAX_SEED)
    models: dict[str, dict[str, Any]] = Field(default_factory=dict)  # settings by model, under those of its rows
    defaults: dict[str, Any] = Field(default_factory=dict)
    rows: list[dict[str, Any]] = Field(default_factory=list)


def load_matrix(name_or_path: str, *, models: Sequence[str] = ()) -> Matrix:
    """Read a matrix file, or a preset by its name, and add a row for each of `models`, named after its class.

    Raises:
        ConfigError: names file, row and key at fault.
    """
    file, path = _read(name_or_path)
    for model in models:
        _require_model(model)
    added = [{"name": model.rpartition(":")[2], "model": model} for model in models]
    return _resolve(file.model_copy(update={"rows": [*file.rows, *added]}), path)


def _require_model(name: str) -> None:
    """Refuse a model of a command line that cannot be there; one of a file is a row that fails when its turn comes."""
    try:
        if ":" in name:
            file, _, cls = name.rpartition(":")
            require_python(Path(file))
            if not cls.isidentifier():
                raise ConfigError(f"{cls!r} is not the name of a class; a model is given as path.py:Class", path=file)
            require_defined(Path(file), cls)
        elif name not in (known := model_names()):
            raise ConfigError(f"{not_one_of(name, [*known, 'path.py:Class'])}")
    except InputError as error:
        raise ConfigError(str(error), field="model") from None


def _read(name: str, *above: Path) -> tuple[_MatrixFile, Path]:
    """Read a preset or a file with all that it extends; `above` are the files that extend it, the nearest last."""
    path, value = _load(name, *above)
    file = _with_class_sets(parse_config(_MatrixFile, value, path=path), path)
    if file.extends is None:
        if file.without:
            raise ConfigError("names rows of a base, and there is no `extends`", path=path, field="without")
        return file, path
    if path.resolve() in [other.resolve() for other in above]:
        raise ConfigError(f"{file.extends!r} leads back to this file", path=path, field="extends")
    base, base_path = _read(file.extends, *above, path)
    _resolve(base, base_path)  # a fault of the base is named as such
    return _extended(base, file, path), path


def _with_class_sets(file: _MatrixFile, path: Path) -> _MatrixFile:
    """Read the class sets that a file names, by paths relative to it."""
    rows = [_with_class_set(row, path, f"{_place(row, count)}: grid.classes") for count, row in enumerate(file.rows, 1)]
    defaults = _with_class_set(file.defaults, path, "defaults.grid.classes")
    return file.model_copy(update={"rows": rows, "defaults": defaults})


def _with_class_set(row: dict[str, Any], path: Path, field: str) -> dict[str, Any]:
    return row | {"grid": with_classes(row["grid"], path, field)} if "grid" in row else row


def _place(row: dict[str, Any], count: int) -> str:
    return f"row {row['name']!r}" if row.get("name") else f"row number {count}"


def _load(name: str, *above: Path) -> tuple[Path, object]:
    if name in preset_names():
        with resources.as_file(resources.files("semgrid_eval.presets") / f"{name}.yaml") as place:
            return Path(f"preset {name}"), load_yaml(place)
    path = above[-1].parent / name if above else Path(name)
    if os.path.lexists(path):  # what is no file is refused as such
        value = load_yaml(path)
        return path, {} if value is None else value
    presets = preset_names()
    fault = f"is neither a file nor a preset ({', '.join(presets)}){meant(name, presets)}"
    if above:
        raise ConfigError(f"{path} {fault}", path=above[-1], field="extends")
    raise ConfigError(fault, path=path)


def _extended(base: _MatrixFile, file: _MatrixFile, path: Path) -> _MatrixFile:
    names = [_written_name(row) for row in base.rows]
    for name in file.without:
        if name not in names:
            raise ConfigError(f"row {not_one_of(name, names)}", path=path, field="without")
    rows = [row for name, row in zip(names, base.rows, strict=True) if name not in file.without]
    unchanged = {_written_name(row): place for place, row in enumerate(rows)}
    for row in file.rows:
        # A row is changed once; written again it is a new one, whose name is taken.
        place = unchanged.pop(_written_name(row), None)
        if place is None:
            rows.append(row)
        else:
            rows[place] = merged(rows[place], row)
    seed = base.seed if file.seed is None else file.seed
    models, defaults = merged(base.models, file.models), merged(base.defaults, file.defaults)
    return _MatrixFile(title=file.title, seed=seed, models=models, defaults=defaults, rows=rows)


def _written_name(row: dict[str, Any]) -> str:
    """Return a row's name before axes fill it in."""
    return str(row.get("name", ""))


def _resolve(file: _MatrixFile, path: Path) -> Matrix:
    rows = [_parsed(row, f"{path}: {place}") for place, row in _expanded(file, path)]
    if not rows:
        raise ConfigError("there is no row", path=path, field="rows")
    for model in file.models:
        if not is_named(model):
            raise ConfigError(not_one_of(model, model_names()), path=path, field="models")
    name, count = Counter(row.name for row in rows).most_common(1)[0]
    if count > 1:
        raise ConfigError(f"{name!r} is the name of {count} rows", path=path, field="rows.name")
    first = rows[0]
    if other := next((row for row in rows if row.grid.classes != first.grid.classes), None):
        fault = f"rows {first.name!r} and {other.name!r} have different ones; all rows of a matrix have the same"
        raise ConfigError(fault, path=path, field="grid.classes")
    return Matrix(title=file.title or path.stem, seed=file.seed or 0, rows=tuple(rows))


def _parsed(row: dict[str, Any], place: str) -> Row:
    try:
        return parse_config(Row, row, path=place)
    except InputError as error:
        if error.path is not None:
            raise
        raise ConfigError(str(error), path=place) from None  # what a model says of its settings


def _expanded(file: _MatrixFile, path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Merge defaults into each row, multiply it by its axes, and put its model's settings under its own."""
    number = 0
    for count, row in enumerate(file.rows, start=1):
        place = _place(row, count)
        whole = merged(file.defaults, row)
        axes = parse_config(_WithAxes, {"axes": whole.pop("axes", {})}, path=f"{path}: {place}").axes
        number += math.prod(len(values) for values in axes.grid.values()) * max(map(len, axes.zip.values()), default=1)
        if number > ROW_LIMIT:
            raise ConfigError(f"give {plural(number, 'row')}, and {ROW_LIMIT:,} are allowed", path=path, field="axes")
        for values in _combinations(axes, f"{path}: {place}"):
            filled = _fill(whole, values, f"{path}: {place}")
            _refuse_class_file(filled, f"{path}: {place}")
            yield place, _with_bases(filled, file.models)


def _refuse_class_file(row: dict[str, Any], place: str) -> None:
    """Refuse the file of a class set that an axis names; all others are read by now."""
    grid = row.get("grid")
    if isinstance(grid, dict) and isinstance(name := grid.get("classes"), str):
        fault = f"{name!r} comes from an axis, and all rows of a matrix have the same classes: name it under defaults"
        raise ConfigError(fault, path=place, field="grid.classes")


def _with_bases(row: dict[str, Any], models: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Put under a row's settings those of its model, and under its validation window its window."""
    bases = {"settings": models.get(str(row.get("model"))), "validation_window": row.get("window")}
    over_bases = {
        key: merged(base, row.get(key, {}))
        for key, base in bases.items()
        if isinstance(base, dict) and isinstance(row.get(key, {} if key == "settings" else None), dict)
    }
    return row | over_bases


def _combinations(axes: _Axes, place: str) -> Iterator[dict[str, Any]]:
    lengths = {len(values) for values in axes.zip.values()}
    if len(lengths) > 1:
        raise ConfigError(
            f"lists must be equally long, and have {shown(sorted(lengths))} values", path=place, field="axes.zip"
        )
    together = [dict(zip(axes.zip, values, strict=True)) for values in zip(*axes.zip.values(), strict=True)] or [{}]
    for values in itertools.product(*axes.grid.values()):
        for zipped in together:
            yield dict(zip(axes.grid, values, strict=True)) | zipped


def _fill(row: dict[str, Any], values: dict[str, Any], place: str) -> dict[str, Any]:
    name = row.get("name", values.get("name"))  # as it is written, so that it can have a place for an axis `name`, too
    for key, value in values.items():
        _require_settable(row, key, place)
        nested: Any = value
        for part in reversed(key.split(".")):
            nested = {part: nested}
        row = merged(row, nested)
    if not isinstance(name, str):
        return row
    for key, value in values.items():
        name = name.replace("{" + key + "}", str(value))
    if "{" in name:
        raise ConfigError(f"{name!r} has a place that no axis fills", path=place, field="name")
    return row | {"name": name}


def _require_settable(row: dict[str, Any], key: str, place: str) -> None:
    """Make sure that an axis, a dotted name, can be set in a row: all above it are mappings, or not there."""
    *above, last = key.split(".")
    if not all((*above, last)):
        raise ConfigError(f"{key!r} is not a dotted name of a setting", path=place, field="axes")
    found: Any = row
    for number, part in enumerate(above, start=1):
        found = found.get(part, {})
        if found is None:  # not set
            return
        if not isinstance(found, dict):
            fault = f"must be a mapping of keys to values, as the axis {key} sets one, not {shown(found)}"
            raise ConfigError(fault, path=place, field=".".join(above[:number]))
