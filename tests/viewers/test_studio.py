"""A played log and its layout, opened in Foxglove Studio and looked at."""

import io
import shutil

import numpy as np
import pytest
from PIL import Image
from support.small_runs import run, write_logs
from support.studio import FLAGS, require_viewers, served

from semgrid_eval.classes import CLASSES
from semgrid_eval.playback.write import Play, write_playback

webdriver = pytest.importorskip("selenium.webdriver", reason="Selenium is not installed (pip install selenium)")
wait = pytest.importorskip("selenium.webdriver.support.wait")
ActionChains = pytest.importorskip("selenium.webdriver.common.action_chains").ActionChains
Keys = pytest.importorskip("selenium.webdriver.common.keys").Keys
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="no Chromium with chromedriver is installed (apt install chromium-driver)"
)
PATIENCE_S = 240  # until something is given up that takes a few seconds
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
COLOURS = {each.name: each.colour for each in CLASSES}


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A browser in which Studio has opened a log of two rows."""
    require_viewers()
    folder = tmp_path_factory.mktemp("studio")
    rows = [{"name": "newest", "model": "newest"}, {"name": "table", "model": "table"}]
    run(rows, write_logs(folder / "logs"), folder / "run")
    written = write_playback(Play(folder / "run", ("newest", "table"), folder / "logs"), folder / "play.mcap")
    (folder / "page").mkdir()
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(flag)
    with served(written.log, written.layout, folder / "page") as address:
        driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
        try:
            driver.get(address)
            until(driver, lambda: len(panels(driver)) == len(TITLES))
            ActionChains(driver).key_down(Keys.CONTROL).send_keys("b").key_up(Keys.CONTROL).perform()  # no sidebar
            yield driver
        finally:
            driver.quit()


def panels(driver):
    """All panels by their titles."""
    script = """
    return [...document.querySelectorAll('header[data-testid=mosaic-drag-handle]')]
      .map(header => [header.innerText.split("\\n")[0].trim(), header.closest('.mosaic-tile')])
    """
    return dict(driver.execute_script(script))


def colours(panel):
    """How many pixels of each class's colour a panel shows: viewers round colours, and draw nothing over most cells."""
    picture = np.asarray(Image.open(io.BytesIO(panel.screenshot_as_png)).convert("RGB")).astype(int)
    return {name: int((np.abs(picture - colour).max(axis=-1) <= 3).sum()) for name, colour in COLOURS.items()}


def until(driver, found):
    return wait.WebDriverWait(driver, PATIENCE_S, poll_frequency=1).until(lambda _: found())


def test_all_panels_are_there_with_their_titles(studio):
    assert sorted(panels(studio)) == sorted(TITLES)
    assert studio.execute_script("return faults") == []


@pytest.mark.parametrize("title", TITLES[3:7])
def test_grids_are_drawn_in_the_colours_of_their_classes(studio, title):
    assert until(studio, lambda: colours(panels(studio)[title])["road"] > 500)


def test_the_legend_is_drawn_with_every_class(studio):
    assert until(studio, lambda: min(colours(panels(studio)["Legend"]).values()) > 20)
