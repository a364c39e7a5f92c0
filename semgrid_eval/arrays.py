"""Named arrays on disk: sealed npz files of bounded size, nothing pickled, equal arrays giving equal bytes."""

import io
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import ResultError
from semgrid_eval.files import open_regular
from semgrid_eval.seals import open_seal, read_sealed, write_sealed

_ARRAY_LIMIT_BYTES = 8 << 30
# All that zipfile and numpy were seen to raise on damaged files.
_DAMAGE = (
    *(OSError, ValueError, EOFError, TypeError, RuntimeError, SyntaxError, MemoryError, OverflowError),
    *(struct.error, zlib.error, zipfile.BadZipFile, tokenize.TokenError),
)


def write_arrays(path: Path, arrays: dict[str, NDArray[Any]], *, owner: str = "") -> None:
    """Write arrays as a compressed npz, atomically, the same arrays always giving the same bytes.

    `owner` is the id of what they belong to.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED, compresslevel=4) as archive:
        archive.comment = open_seal(owner).encode()
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, buffer.getvalue())
    write_sealed(path, content.getvalue())


def read_arrays(
    path: Path,
    names: tuple[str, ...],
    *,
    owner: str | None = None,
    optional: tuple[str, ...] = (),
    verify: bool = True,
) -> dict[str, NDArray[Any]]:
    """Read the named arrays of an npz, and those of `optional` that it has; sizes bounded, nothing pickled.

    Who has just compared the file with its seal need not do it again (`verify`).

    Raises:
        ResultError: the file is missing, damaged, too large, lacks an array or belongs to another `owner`, if given.
    """
    source = io.BytesIO(read_sealed(path, owner, limit=_ARRAY_LIMIT_BYTES)) if verify else open_regular(path)
    try:
        with source, zipfile.ZipFile(source) as archive:
            sizes = {entry.filename.removesuffix(".npy"): entry.file_size for entry in archive.infolist()}
            if (size := sum(sizes.values())) > _ARRAY_LIMIT_BYTES:
                raise ResultError(f"would need {size >> 20} MiB", path=path)
            for name in names:
                if name not in sizes:
                    raise ResultError(f"has no array {name}", path=path)
            return {name: _array(archive, name) for name in (*names, *optional) if name in sizes}
    except _DAMAGE as error:
        raise ResultError(f"cannot be read: {error}", path=path) from error


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    with archive.open(f"{name}.npy") as stream:
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))
