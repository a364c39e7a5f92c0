"""How inputs are changed at random, and what has to hold of the reading of them."""

import random
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

Inputs = Mapping[str, bytes]


def same(whole: bytes, data: bytes, expected: object, found: object) -> bool:
    return found == expected


def never(whole: bytes, data: bytes, expected: object, found: object) -> bool:
    """No change may be accepted."""
    return False


@dataclass(frozen=True)
class Kind:
    """One kind of input, by names of files below a folder."""

    inputs: Callable[[Path], dict[str, bytes]]
    read: Callable[[Path, str], object]
    mutate: Callable[[Inputs, str, random.Random], bytes]
    has_checksums: bool = True
    agrees: Callable[[bytes, bytes, object, object], bool] = same

    def put(self, folder: Path, name: str, data: bytes) -> None:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def anyhow(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change some bytes, stretches, or the length."""
    data = inputs[name]
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        data = chance.choice(WAYS)(data, chance)
    return data


def _flip(data: bytes, chance: random.Random) -> bytes:
    if not data:
        return b"\0"
    at = chance.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]


def _stretch(data: bytes, chance: random.Random) -> tuple[int, int]:
    at = chance.randint(0, len(data))
    return at, min(at + chance.choice((1, 4, 8, 64, 512, 4096)), len(data))


def _fill(data: bytes, chance: random.Random) -> bytes:
    at, end = _stretch(data, chance)
    filling = chance.choice((b"\0", b"\xff", b"")) * (end - at) or chance.randbytes(end - at)
    return data[:at] + filling + data[end:]


def _cut(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randint(0, len(data))]


def _drop(data: bytes, chance: random.Random) -> bytes:
    at, end = _stretch(data, chance)
    return data[:at] + data[end:]


def _double(data: bytes, chance: random.Random) -> bytes:
    at, end = _stretch(data, chance)
    return data[:end] + data[at:]


def _number(data: bytes, chance: random.Random) -> bytes:
    """Write a number that breaks sums over some bytes."""
    size = chance.choice((1, 2, 4, 8))
    value = chance.choice((0, 1, (1 << 8 * size) - 1, 1 << (8 * size - 1), (1 << (8 * size - 1)) - 1))
    at = chance.randint(0, max(len(data) - size, 0))
    return data[:at] + value.to_bytes(size, chance.choice(("little", "big"))) + data[at + size :]


def _more(data: bytes, chance: random.Random) -> bytes:
    return data + chance.randbytes(chance.randint(1, 64))


WAYS = (_flip, _flip, _flip, _fill, _fill, _cut, _drop, _double, _number, _number, _more)


def words(inputs: Inputs, name: str, chance: random.Random) -> bytes:
    """Change text: as any bytes, or a word of it for another that means something to a parser."""
    if chance.random() < 0.4:
        return anyhow(inputs, name, chance)
    parts = re.split(r"(\w+|[^\w\s])", inputs[name].decode("utf-8", "replace"))
    for _ in range(chance.choice((1, 1, 2, 4))):
        parts[chance.randrange(len(parts))] = chance.choice((*WORDS, chance.choice(parts)))
    return "".join(parts).encode("utf-8", "surrogatepass")


WORDS = (
    *(
        "0",
        "-1",
        "1e999",
        "nan",
        "NaN",
        "Infinity",
        "9" * 30,
        "9" * 5000,
        "0x1f",
        "010",
        "1.5",
        "true",
        "null",
        "''",
        "~",
    ),
    *(
        "[",
        "]",
        "{",
        "}",
        ":",
        ",",
        "-",
        "\n",
        "\t",
        "  ",
        "#",
        "&a",
        "*a",
        "!!int",
        "<<",
        "|",
        ">",
        "%",
        "\0",
        "\ud800",
    ),
    *(
        '"',
        "\\u0000",
        "\\ud800",
        "é",
        "\u202e",
        "[" * 3000,
        "{camera}",
        "../..",
        "/dev/zero",
        "x" * 400,
        "a.py:B",
        "none",
    ),
)


def changed_bytes(data: bytes, chance: random.Random) -> bytes:
    return anyhow({"": data}, "", chance)
