"""A played log and its layout, opened in Foxglove Studio and looked at."""

import pytest
from support.small_runs import run, write_logs
from support.studio import CHROMIUM, DRIVER, colours, opened, panels, require_viewers, until

from semgrid_eval.playback.write import Play, write_playback

pytest.importorskip("selenium", reason="Selenium is not installed (pip install selenium)")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (CHROMIUM and DRIVER), reason="no Chromium with chromedriver is installed (apt install chromium-driver)"
    ),
]
TITLES = [
    "Camera",
    "Labels",
    "Legend",
    "Newest input of row 1, moved to the target's time",
    "Target; white is left out of scores",
    "Prediction 1",
    "Prediction 2",
    "Certainty 2; white is 1",
]


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A browser in which Studio has opened a log of two rows."""
    require_viewers()
    folder = tmp_path_factory.mktemp("studio")
    rows = [{"name": "newest", "model": "newest"}, {"name": "table", "model": "table"}]
    run(rows, write_logs(folder / "logs"), folder / "run")
    play = Play(folder / "run", ("newest", "table"), folder / "logs", grids=folder / "grids")
    written = write_playback(play, folder / "play.mcap")
    assert written.notes == ()
    with opened(written.log, written.layout, folder / "viewer") as driver:
        yield driver


def test_all_panels_are_there_with_their_titles(studio):
    assert list(panels(studio)) == TITLES
    assert studio.execute_script("return faults") == []


@pytest.mark.parametrize("title", TITLES[3:7])
def test_grids_are_drawn_in_the_colours_of_their_classes(studio, title):
    assert until(studio, lambda: colours(panels(studio)[title])["road"] > 500)


def test_the_legend_is_drawn_with_every_class(studio):
    assert until(studio, lambda: min(colours(panels(studio)["Legend"]).values()) > 20)
