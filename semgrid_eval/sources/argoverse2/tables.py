"""Read single files of an Argoverse log; what is wrong with one is an InputError that names it and the row."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import feather

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_bytes

MAX_FILE_BYTES = 1 << 30
MAX_STAMP_NS = (1 << 63) - 1
Table = dict[str, NDArray[Any]]


def read_table(path: Path, columns: Mapping[str, str]) -> Table:
    """Read columns of a feather file by name and type: `int64`, `float64` or `string`; numbers are finite."""
    if not path.exists():
        raise InputError("is missing", path=path)
    data = read_bytes(path, limit=MAX_FILE_BYTES)
    try:
        table = feather.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(f"is not a feather file: {error}", path=path) from error
    return {name: _column(table, name, kind, path) for name, kind in columns.items()}


def _column(table: Any, name: str, kind: str, path: Path) -> NDArray[Any]:  # noqa: ANN401 - a pyarrow table
    if name not in table.column_names:
        raise InputError("is missing", path=path, field=name)
    try:
        column = table.column(name).cast(pa.type_for_alias(kind)).combine_chunks()
    except pa.ArrowException as error:
        raise InputError(f"does not hold {kind}: {error}", path=path, field=name) from error
    if column.null_count:
        raise InputError("holds no value in some row", path=path, field=name)
    values: NDArray[Any] = column.to_numpy(zero_copy_only=False)
    if kind == "float64" and len(wrong := np.flatnonzero(~np.isfinite(values))):
        raise InputError(f"row {wrong[0]}: {values[wrong[0]]} is not finite", path=path, field=name)
    if name == "timestamp_ns" and len(wrong := np.flatnonzero((values < 0) | (values >= MAX_STAMP_NS))):
        raise InputError(f"row {wrong[0]}: {values[wrong[0]]} ns is not a time", path=path, field=name)
    return values
