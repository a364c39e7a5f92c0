"""The demo on logs of a toy world: it says all that failed, and still shows the page."""

import pytest
import yaml
from click.testing import CliRunner
from support.toy_world import street

from semgrid_eval.cli.main import cli
from semgrid_eval.errors import InputError
from semgrid_eval.log.convert import ConversionSummary
from semgrid_eval.log.store import write_log
from semgrid_eval.runs import matrix
from semgrid_eval.sources.town import convert as town

ROWS = [{"name": "BL-DC", "model": "newest"}, {"name": "BL-broken", "model": "absent.py:Model"}]


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """Let a toy world take the place of the town, one of whose logs is broken, and two rows that of the preset."""

    def convert(config, out, work):
        for name in ("a", "b"):
            write_log(street(1, frames=9).recording(name), out / "val" / f"{name}.mcap")
        (out / "val" / "c.mcap").write_bytes(b"broken")
        assert config.recordings == 4
        return ConversionSummary(written=["val/a", "val/b", "val/c"], failed={"val/d": "SUMO stopped"})

    window = {"step_frames": 3, "target_frame": 8}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"defaults": {"window": window}, "rows": ROWS}))
    load = matrix.load_matrix
    monkeypatch.setattr(matrix, "load_matrix", lambda _: load(str(tmp_path / "m.yaml")))
    monkeypatch.setattr(town, "convert_town", convert)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_fails_is_named_and_the_rest_is_shown(toy):
    result = CliRunner().invoke(cli, ["demo", "--recordings", "4", "--workers", "1"], standalone_mode=False)
    assert result.return_value == 1
    for told in ("val/d: SUMO stopped", "row BL-broken: ", "val/c.mcap: "):
        assert f"Error: {told}" in result.stderr
    page = result.stdout.strip()
    assert page == "demo/run/report/index.html"
    assert "BL-DC" in (toy / page).read_text()


def test_a_seed_that_no_town_has_is_one_line():
    with pytest.raises(InputError, match="--seed: must be below"):
        CliRunner().invoke(cli, ["demo", "--seed", "3000000000"], standalone_mode=False, catch_exceptions=False)
