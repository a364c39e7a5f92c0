"""Bad folders of runs: missing, foreign, damaged, of another version; and what is asked of whole ones."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from support.bad import small
from support.bad.case import Bad, Kind, run

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.scores import results
from semgrid_eval.seals import write_sealed_json

PLAY, REPORT = "play run BL --out play.mcap", "report run"
GATE = "report run other --out page --fail-below 'road: -0.01' --row BL=LB"
LIVE = "play run live --stream --out play.mcap"
ROWS = [
    {"name": "BL", "model": "newest"},
    {"name": "live", "model": "newest", "stream": {"latency_ms": 50}},
    {"name": "told", "model": "log", "settings": {"folder": "nowhere"}},
]


def whole() -> None:
    """Write good logs, and a run of three rows, of which one has failed."""
    small.whole()
    window = yaml.safe_load(f"{{{small.WINDOW}}}")
    Path("base.yaml").write_text(yaml.safe_dump({"defaults": window, "rows": ROWS}))
    run("run base.yaml --logs logs --out run --grids grids --workers 1 --device cpu")


def _result(name: str = "BL") -> Path:
    rows = {row.name: row.results for row in results.read_run(Path("run")).rows}
    return results.result_folder(Path("run"), rows[name][0])


def _windows() -> Path:
    return next(Path("run/windows").glob("*.npz"))


def _flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def _sealed(path: Path, owner: str, **changes: Any) -> None:
    """Change what a record says, and seal it again."""
    value = {key: each for key, each in json.loads(path.read_text()).items() if key != "seal"}
    write_sealed_json(path, {key: each for key, each in (value | changes).items() if each is not ...}, owner)


def _record(**changes: Any) -> None:
    _sealed(Path("run/run.json"), "run", **changes)


def _result_record(**changes: Any) -> None:
    folder = _result()
    _sealed(folder / "result.json", folder.name, **changes)


def _smaller(path: Path, name: str, owner: str) -> None:
    """Cut an array of a file, and seal it again."""
    with path.open("rb"):
        found = read_arrays(path, (name, *_ARRAYS[path.name]), owner=owner)
    write_arrays(path, found | {name: found[name][..., :64]}, owner=owner)


_ARRAYS = {"predictions.npz": ("prediction", "certainty"), "stream.npz": (*results._ANSWERS, *results._EVALUATIONS)}


def _without_array(name: str) -> None:
    folder = _result()
    path = folder / "predictions.npz"
    found = read_arrays(path, _ARRAYS[path.name], owner=folder.name)
    write_arrays(path, {key: each for key, each in found.items() if key != name}, owner=folder.name)


def _mine_in_the_way() -> None:
    Path("page").mkdir()
    Path("page/index.html").write_text("a page")
    Path("page/report.json").write_text('{"files": []}')
    Path("page/scores.csv").write_text("mine")


def _bad(words: str, command: str, spoil: Callable[[], object] = lambda: None) -> Bad:
    return Bad(words, command, spoil=spoil)


def _foreign_report() -> None:
    Path("page").mkdir()
    Path("page/mine.txt").write_text("mine")


def _logs_of_another_run() -> None:
    shutil.copy("logs/train/toy0.mcap", "logs/val/toy1.mcap")


KIND = Kind(
    "Folders of runs",
    f"What has become of a run, for `{REPORT}`, `{PLAY}` or the command that is named.",
    whole,
    (
        _bad("`report`: no such folder", "report nowhere"),
        _bad("`report`: a folder of something else", "report logs"),
        _bad("`report`: a file", "report base.yaml"),
        _bad("`report`: no run.json", REPORT, Path("run/run.json").unlink),
        _bad(
            "`report`: run.json is cut",
            REPORT,
            lambda: Path("run/run.json").write_bytes(Path("run/run.json").read_bytes()[:200]),
        ),
        _bad("`report`: run.json is empty", REPORT, lambda: Path("run/run.json").write_bytes(b"")),
        _bad("`report`: run.json is a list", REPORT, lambda: Path("run/run.json").write_text("[]")),
        _bad(
            "`report`: run.json has no seal", REPORT, lambda: Path("run/run.json").write_text('{"format_version": 1}')
        ),
        _bad("`report`: run.json was changed by hand", REPORT, lambda: _by_hand()),
        _bad("`report`: run.json of another version", REPORT, lambda: _record(format_version=99)),
        _bad("`report`: run.json without rows", REPORT, lambda: _record(rows=...)),
        _bad("`report`: run.json with an unknown key", REPORT, lambda: _record(colour="red")),
        _bad("`report`: --out is a file", f"{REPORT} --out base.yaml"),
        _bad("`report`: --out is a folder of something else", f"{REPORT} --out page", _foreign_report),
        _bad("`report`: --out is the run itself", f"{REPORT} --out run"),
        _bad("`report`: several runs without --out", "report run other"),
        _bad("`report`: the same run twice", "report run logs/../run --out page"),
        _bad(
            "`report`: a gate of a row that the later run calls otherwise",
            GATE,
            lambda: shutil.copytree("run", "other"),
        ),
        _bad("`report`: a result is damaged", REPORT, lambda: _flip(_result() / "sums.npz")),
        _bad("`play`: no such folder", "play nowhere BL --out play.mcap"),
        _bad("`play`: no such row", "play run BI --out play.mcap"),
        _bad("`play`: a row that has failed", "play run told --out play.mcap"),
        _bad("`play`: a stream without --stream", "play run live --out play.mcap"),
        _bad("`play`: --stream, and the row is none", "play run BL --stream --out play.mcap"),
        _bad("`play`: no such recording", f"{PLAY} --recording toy7"),
        _bad("`play`: --recording and --all", f"{PLAY} --recording toy1 --all"),
        _bad("`play`: --stream and --all", f"{LIVE} --all"),
        _bad("`play`: the folder of a result is gone", PLAY, lambda: shutil.rmtree(_result())),
        _bad("`play`: predictions are gone", PLAY, lambda: (_result() / "predictions.npz").unlink()),
        _bad("`play`: predictions are damaged", PLAY, lambda: _flip(_result() / "predictions.npz")),
        _bad("`play`: predictions are those of another result", PLAY, lambda: _of_another()),
        _bad("`play`: predictions are empty", PLAY, lambda: (_result() / "predictions.npz").write_bytes(b"")),
        _bad(
            "`play`: predictions of another size",
            PLAY,
            lambda: _smaller(_result() / "predictions.npz", "prediction", _result().name),
        ),
        _bad("`play`: predictions without certainty", PLAY, lambda: _without_array("certainty")),
        _bad(
            "`play`: a stream's grids of another size",
            LIVE,
            lambda: _smaller(_result("live") / "stream.npz", "target", _result("live").name),
        ),
        _bad("`report`: a file of mine where the page will be", f"{REPORT} --out page", _mine_in_the_way),
        _bad("`play`: windows are gone", PLAY, lambda: _windows().unlink()),
        _bad("`play`: windows are damaged", PLAY, lambda: _flip(_windows())),
        _bad("`play`: result.json is damaged", PLAY, lambda: _flip(_result() / "result.json")),
        _bad("`play`: result.json is gone", PLAY, lambda: (_result() / "result.json").unlink()),
        _bad("`play`: result.json of another version", PLAY, lambda: _result_record(format_version=1)),
        _bad("`play`: result.json of another id", PLAY, lambda: _result_record(id="0" * 16)),
        _bad("`play`: result.json without windows", PLAY, lambda: _result_record(windows=...)),
        _bad(
            "`play`: result.json with a grid that is none",
            PLAY,
            lambda: _result_record(config={"grid": {"spec": {"rows": 3}}}),
        ),
        _bad("`play`: a stream's grids are damaged", LIVE, lambda: _flip(_result("live") / "stream.npz")),
        _bad("`play`: --out is a matrix", "play run BL --out base.yaml"),
        _bad("`play`: --out is a log", "play run BL --out logs/val/toy1.mcap"),
        _bad("`play`: --out lies among logs", "play run BL --out logs/val/new.mcap"),
        _bad("`play`: --out lies in --logs", "play run BL --logs logs --out logs/new.mcap"),
        _bad(
            "`play`: the layout beside --out is another file", PLAY, lambda: Path("play.layout.json").write_text("{}")
        ),
        _bad("`play`: --logs is not there", f"{PLAY} --logs nowhere"),
        _bad("`play`: --logs lacks the log", f"{PLAY} --logs logs/train"),
        _bad("`play`: the log is another now", f"{PLAY} --logs logs", _logs_of_another_run),
    ),
)


def _by_hand() -> None:
    path = Path("run/run.json")
    path.write_text(path.read_text().replace('"seconds": ', '"seconds": 1'))


def _of_another() -> None:
    shutil.copy(_result("live") / "sums.npz", _result() / "predictions.npz")
