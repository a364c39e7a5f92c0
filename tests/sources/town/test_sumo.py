import sys

import pytest

from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.sources.town import simulation
from semgrid_eval.sources.town.sensors import RayCaster


def test_sumo_s_own_message_is_passed_on_in_one_line(tmp_path):
    with pytest.raises(InputError, match=r"SUMO's netconvert failed with exit code 1: .*nodes") as caught:
        simulation.run_binary(
            "netconvert", ["-n", "missing.nod.xml", "-e", "missing.edg.xml", "-o", "out.xml"], tmp_path
        )
    assert "\n" not in str(caught.value)


def test_a_tool_that_fails_says_why(tmp_path):
    with pytest.raises(InputError, match=r"SUMO's randomTrips failed with exit code \d: .*"):
        simulation.run_tool("randomTrips", ["-n", "missing.net.xml"], tmp_path)


def test_without_sumo_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sumo", None)
    with pytest.raises(MissingExtraError, match=r"eclipse-sumo is not installed; run: pip install 'semgrid-eval\[synt"):
        simulation.sumo_home()


def test_without_embree_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    with pytest.raises(MissingExtraError, match=r"embreex is not installed; run: pip install 'semgrid-eval\[synthetic"):
        RayCaster([])


def test_a_binary_that_cannot_start_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(simulation, "sumo_home", lambda: tmp_path)
    with pytest.raises(InputError, match="SUMO's netgenerate cannot be started: No such file"):
        simulation.run_binary("netgenerate", [], tmp_path)


def test_a_binary_that_is_killed_says_so(monkeypatch, tmp_path):
    (tmp_path / "bin").mkdir()
    script = tmp_path / "bin/sumo"
    script.write_text("#!/bin/sh\nkill -9 $$\n")
    script.chmod(0o755)
    monkeypatch.setattr(simulation, "sumo_home", lambda: tmp_path)
    with pytest.raises(InputError, match=r"SUMO's sumo was killed by signal 9 \(out of memory\?\)"):
        simulation.run_binary("sumo", [], tmp_path)
