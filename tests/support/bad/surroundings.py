"""What is odd about files and folders themselves: pipes, devices, loops, sizes, names, and what is in the way."""

import os
from collections.abc import Callable
from pathlib import Path

from support.bad import cityscapes, small
from support.bad.case import Bad, Kind

RUN = "run base.yaml --logs logs --grids grids --workers 1 --device cpu --out"
CONVERT = "convert cityscapes SRC logs --workers 1"
VEHICLE = cityscapes.TREE.vehicle(cityscapes.FIRST)


def whole() -> None:
    """Write good logs with their grids, a matrix of one row, a tree and a file."""
    small.whole()
    cityscapes.whole()
    Path("base.yaml").write_bytes(small.matrix("model: newest"))
    Path("file.txt").write_text("text")


def _bad(words: str, command: str, spoil: Callable[[], object] = lambda: None) -> Bad:
    return Bad(words, command, spoil=spoil)


def _sparse(path: str | Path) -> None:
    """Make a file of 1 TiB that takes no room."""
    with Path(path).open("wb") as stream:
        stream.truncate(1 << 40)


def _in_its_place(make: Callable[[Path], object], path: Path) -> Callable[[], None]:
    def spoil() -> None:
        path.unlink()
        make(path)

    return spoil


def _loop(name: str | Path) -> None:
    Path(name).symlink_to(Path(name).name)


KIND = Kind(
    "Files and folders",
    "What a path leads to, or what is in the way of what is written.",
    whole,
    (
        _bad("`run --out` below a file", f"{RUN} file.txt/out"),
        _bad("`run --out`: a name of 300 letters", f"{RUN} {'o' * 300}"),
        _bad("`run --out`: a link to itself", f"{RUN} loop", lambda: _loop("loop")),
        _bad("`run --out`: a link to nowhere", f"{RUN} link", lambda: Path("link").symlink_to("gone")),
        _bad("`run --out`: run.json there is a folder", f"{RUN} out", lambda: Path("out/run.json").mkdir(parents=True)),
        _bad(
            "`run --out`: results there is a file",
            f"{RUN} out",
            lambda: (Path("out").mkdir(), Path("out/results").touch()),
        ),
        _bad("`grids`: OUT below a file", "grids logs/val file.txt/grids --workers 1"),
        _bad("`convert`: OUT below a file", "convert cityscapes SRC file.txt/logs --workers 1"),
        _bad("`convert`: OUT where nobody may write", "convert cityscapes SRC /proc/logs --workers 1"),
        _bad("`check --recover`: OUT below a file", "check logs/val --recover file.txt/saved"),
        _bad(
            "`latency --out` below a file",
            "latency logs/val --out file.txt/latency.json --frames 1 --warm-up 0 --threads 1 --device cpu",
        ),
        _bad("the matrix is a pipe", "run pipe.yaml --logs logs --out out", lambda: os.mkfifo("pipe.yaml")),
        _bad("the grid's configuration is a device", "grids logs out --config /dev/zero"),
        _bad("the matrix is a link to itself", "run loop.yaml --logs logs --out out", lambda: _loop("loop.yaml")),
        _bad("the contract is a pipe", "check logs --spec spec.yaml", lambda: os.mkfifo("spec.yaml")),
        _bad("the contract has 1 TiB", "check logs --spec spec.yaml", lambda: _sparse("spec.yaml")),
        _bad("the log is a pipe", "check pipe.mcap", lambda: os.mkfifo("pipe.mcap")),
        _bad("the log is a device", "check /dev/zero"),
        _bad(
            "the log is a link to nowhere",
            "grids more out --workers 1",
            lambda: (Path("more").mkdir(), Path("more/a.mcap").symlink_to("gone")),
        ),
        _bad("the vehicle file has 1 TiB", CONVERT, _in_its_place(_sparse, VEHICLE)),
        _bad("the vehicle file is a pipe", CONVERT, _in_its_place(os.mkfifo, VEHICLE)),
        _bad("the vehicle file is a link to itself", CONVERT, _in_its_place(_loop, VEHICLE)),
        _bad("the colour image has 1 TiB", CONVERT, _in_its_place(_sparse, cityscapes.TREE.image(cityscapes.FIRST))),
        _bad("the network has 1 TiB", "segment logs --model net.onnx --out out", lambda: _sparse("net.onnx")),
        _bad("the network is a pipe", "segment logs --model net.onnx --out out", lambda: os.mkfifo("net.onnx")),
        _bad("run.json is a pipe", "report run", lambda: (Path("run").mkdir(), os.mkfifo("run/run.json"))),
        _bad("run.json has 1 TiB", "report run", lambda: (Path("run").mkdir(), _sparse("run/run.json"))),
        _bad(
            "a folder of logs with a pipe",
            "grids more out --workers 1",
            lambda: (Path("more").mkdir(), os.mkfifo("more/a.mcap")),
        ),
        _bad("a matrix with a line break in its name", "run 'two\nlines.yaml' --logs logs --out out"),
        _bad("a matrix with an escape in its name", "run 'red\x1b[31m.yaml' --logs logs --out out"),
    ),
)
