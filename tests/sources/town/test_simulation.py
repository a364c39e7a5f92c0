"""Traffic from what SUMO writes, and what is said when it wrote nothing."""

import pytest
from support.towns import SMALL

from semgrid_eval.errors import InputError
from semgrid_eval.sources.town import simulation
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.town import TownSpec, prepare_town

HEADER = "timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_speed;vehicle_type\n"


def sumo_that_writes(text, monkeypatch):
    """Let SUMO's simulation, and it alone, be over at once with these trajectories."""

    def run(name, options, folder):
        (folder / options[options.index("--fcd-output") + 1]).write_text(text)

    monkeypatch.setattr(simulation, "run_binary", run)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEADER, "the town is empty: nobody moved in it; ask for a larger town or a longer time"),
        ("", "SUMO's trajectories cannot be read"),
        ("timestep_time;x\n0.0;1.0\n", "SUMO's trajectories cannot be read .*SUMO 1.28 writes them"),
    ],
)
def test_a_town_without_traffic_is_refused_and_not_kept(text, message, monkeypatch, tmp_path):
    sumo_that_writes(text, monkeypatch)
    spec = TownSpec(0, KINDS[0].name, SMALL["seed"], SMALL["town_size_m"], SMALL["duration_s"])
    with pytest.raises(InputError, match=message):
        prepare_town(spec, tmp_path)
    assert list(tmp_path.iterdir()) == []
