"""The page in headless Chromium, driven by Selenium; skipped where either is missing."""

import csv
import json
import shutil
import subprocess
import time

import pytest
from support.browser import open_page

from semgrid_eval.classes import DEFAULT_CLASSES, MASK_COLOUR

pytestmark = pytest.mark.slow


@pytest.fixture
def opened(browser, page):
    open_page(browser, page, width=1280)
    return browser


def _first_column(browser, table):
    script = "return [...document.querySelectorAll(arguments[0])].map(each => each.textContent)"
    return browser.execute_script(script, f"{table} tbody tr:first-child .name")


def test_tables_and_pictures_are_shown_without_error_or_request(opened, page):
    script = """
    const done = arguments[0];
    const pictures = [...document.images];
    document.querySelectorAll('details').forEach(part => { part.open = true; });
    pictures.forEach(picture => { picture.loading = 'eager'; });
    Promise.all(pictures.map(picture => picture.decode().catch(() => null)))
      .then(() => done(pictures.map(picture => picture.naturalWidth)));
    """
    widths = opened.execute_async_script(script)
    assert len(widths) > 30
    assert min(widths) > 0
    assert opened.execute_script("return document.querySelectorAll('table tbody tr').length") > 20
    log = [json.loads(entry["message"])["message"] for entry in opened.get_log("performance")]
    requests = [entry["params"]["request"]["url"] for entry in log if entry["method"] == "Network.requestWillBeSent"]
    assert {url for url in requests if not url.startswith("data:")} == {page.as_uri()}
    assert opened.get_log("browser") == []


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("name", ["page", "side_by_side", "troubled"])
def test_nothing_scrolls_sideways(browser, request, name, width):
    open_page(browser, request.getfixturevalue(name), width=width)
    script = """
    document.querySelectorAll('details').forEach(part => { part.open = true; });
    return [document.documentElement.scrollWidth, document.documentElement.clientWidth];
    """
    wide, shown = browser.execute_script(script)
    assert wide <= shown <= width
    assert browser.get_log("browser") == []


def test_a_printed_page_holds_every_table(browser, page):
    open_page(browser, page, width=718)  # A4 less its margins
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    script = """
    window.dispatchEvent(new Event('beforeprint'));
    const wide = [...document.querySelectorAll('table')].map(table => table.getBoundingClientRect().right);
    return [Math.max(...wide), document.querySelectorAll('details:not([open], .chooser)').length,
            getComputedStyle(document.querySelector('.tools')).display];
    """
    right, closed, tools = browser.execute_script(script)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert right <= 718
    assert closed == 0
    assert tools == "none"


def test_how_trainings_were_scaled_is_read_whole_on_a_phone(browser, page):
    open_page(browser, page, width=390)
    script = """
    const line = document.querySelector('#summary .hint.name');
    line.textContent = 'updates an epoch 150 instead of 185, '.repeat(9);
    return [line.scrollHeight, line.clientHeight];
    """
    whole, shown = browser.execute_script(script)
    assert whole <= shown


def test_a_wide_figure_is_reached_by_keyboard_on_a_phone(browser, page):
    open_page(browser, page, width=390)
    browser.execute_script("document.querySelectorAll('details').forEach(part => { part.open = true; })")
    script = """
    return [...document.querySelectorAll('.canvas')].map(each =>
      [each.scrollWidth > each.clientWidth, each.tabIndex === 0 && each.ariaLabel.length > 20]);
    """

    def reached(driver):
        canvases = driver.execute_script(script)
        return any(scrolls for scrolls, _ in canvases) and all(scrolls == reached for scrolls, reached in canvases)

    for _ in range(100):  # sizes are told a moment later
        if reached(browser):
            break
        time.sleep(0.05)
    assert reached(browser)


def test_a_click_sorts_and_another_turns_the_order(opened):
    before = _first_column(opened, "#table-categories")
    click = "document.querySelectorAll('#table-categories thead button')[5].click()"
    opened.execute_script(click)
    falling = _first_column(opened, "#table-categories")
    opened.execute_script(click)
    rising = _first_column(opened, "#table-categories")
    assert falling[0] == "ED-DC"  # best on vehicles
    assert rising == falling[::-1] != before
    sort = "return document.querySelectorAll('#table-categories thead th')[5].getAttribute('aria-sort')"
    assert opened.execute_script(sort) == "ascending"


def test_lines_of_one_row_stay_together_when_a_table_is_sorted(opened):
    click = "document.querySelectorAll('#table-findings thead button')[1].click()"
    script = "return [...document.querySelectorAll('#table-findings tbody')].map(body => body.rows.length)"
    before = opened.execute_script(script)
    opened.execute_script(click)
    assert sorted(opened.execute_script(script)) == sorted(before)
    assert min(before) > 1


def test_a_table_can_be_saved_as_csv(opened):
    opened.execute_script("document.querySelector('[data-table=categories] .tools button').click()")
    target = opened.downloads / "categories.csv"
    for _ in range(100):
        if target.is_file():
            break
        time.sleep(0.05)
    with target.open(newline="") as stream:
        lines = list(csv.reader(stream))
    assert lines[0][:3] == ["Row", "Mean (known)", "Static"]
    assert [line[0] for line in lines[:4]] == ["Row", "BL-DC", "BL-NT", "BL-Fuse"]
    assert 0 < float(lines[1][1]) < 1


def test_a_tap_on_a_number_tells_what_stands_behind_it(opened):
    script = """
    const cell = document.querySelector('#table-categories tbody td');
    cell.click();
    return [cell.title, document.querySelector('[data-table=categories] .tip').value];
    """
    title, told = opened.execute_script(script)
    assert told == title
    for words in ("16 windows", "cells", "95% interval"):
        assert words in told


def test_a_command_is_copied_or_at_least_selected(opened):
    script = """
    document.querySelectorAll('details').forEach(part => { part.open = true; });
    document.querySelector('#table-commands .copy').click();
    return getSelection().toString();
    """
    assert opened.execute_script(script) == "semgrid-eval run smoke --logs logs --out run --row BL-DC"


COLOURS = """
const done = arguments[0], picture = document.querySelector('#examples img[alt^="Prediction of"]');
picture.loading = 'eager';
picture.decode().then(() => {
  const canvas = Object.assign(document.createElement('canvas'), {width: 128, height: 128});
  const context = canvas.getContext('2d');
  context.drawImage(picture, 0, 0);
  const pixels = context.getImageData(0, 0, 128, 128).data, found = new Set();
  for (let i = 0; i < pixels.length; i += 4) found.add([...pixels.slice(i, i + 3)].join());
  const road = [...document.querySelectorAll('#examples .legend li')].find(each => each.textContent.trim() === 'road');
  done([[...found], getComputedStyle(road.querySelector('.swatch')).backgroundColor, picture.src]);
});
"""


def test_a_key_switches_pictures_and_legend_to_the_papers_colours_and_back(opened):
    def colours():
        found, road, source = opened.execute_async_script(COLOURS)
        return {tuple(map(int, text.split(","))) for text in found}, road, source

    def press():
        opened.execute_script("document.querySelector('.colours').focus()")
        for kind in ("keyDown", "keyUp"):
            key = {"type": kind, "key": "Enter", "code": "Enter", "text": "\r", "windowsVirtualKeyCode": 13}
            opened.execute_cdp_cmd("Input.dispatchKeyEvent", key)
        return opened.execute_script("return document.querySelector('.colours').getAttribute('aria-pressed')")

    safe = colours()
    assert press() == "true"
    paper = colours()
    assert press() == "false"
    assert colours() == safe
    for (found, road, _), palette in ((safe, DEFAULT_CLASSES.palette(safe=True)), (paper, DEFAULT_CLASSES.palette())):
        allowed = {tuple(colour) for colour in palette.tolist()} | {MASK_COLOUR}
        assert len(found) > 2
        assert found <= allowed
        assert road == "rgb({}, {}, {})".format(*palette[1].tolist())


def test_the_slider_shows_the_steps_of_a_window(opened):
    script = """
    const flip = document.querySelector('.flip'), slider = flip.querySelector('input');
    const seen = [];
    for (let step = 0; step <= slider.max; step++) {
      slider.value = step;
      slider.dispatchEvent(new Event('input'));
      seen.push(flip.querySelector('output').value, flip.querySelector('img').src);
    }
    return seen;
    """
    seen = opened.execute_script(script)
    assert seen[::2] == ["Input 1 of 2", "Input 2 of 2", "Target", "ED-DC"]
    assert len(set(seen[1::2])) == 4


def test_the_keyboard_reaches_the_skip_link_first(opened):
    opened.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyDown", "key": "Tab", "windowsVirtualKeyCode": 9})
    assert opened.execute_script("return document.activeElement.className") == "skip"


@pytest.fixture(scope="module")
def axe(tmp_path_factory):
    """The source of axe-core, which npm fetches where there is a network."""
    npm, folder = shutil.which("npm"), tmp_path_factory.mktemp("axe")
    if npm is None:
        pytest.skip("npm, which would fetch axe-core, is not installed")
    command = [npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", str(folder), "axe-core@4"]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=60)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        pytest.skip("axe-core cannot be fetched (no network)")
    return (folder / "node_modules/axe-core/axe.min.js").read_text(encoding="utf-8")


CONTRAST = "color-contrast"
"""The one rule that depends on the theme and not on the names or rows of a run."""
THIN = "document.querySelectorAll('tbody:nth-of-type(n+4), .window:nth-of-type(n+3)').forEach(part => part.remove())"
"""Leaves three rows of each table and two windows of each group: the others are built alike."""


@pytest.mark.parametrize(
    ("name", "width", "scheme", "options"),
    [
        ("page", 1280, "light", {}),
        ("page", 1280, "dark", {"runOnly": {"type": "rule", "values": [CONTRAST]}}),
        ("side_by_side", 1280, "light", {"rules": {CONTRAST: {"enabled": False}}}),
        ("troubled", 1280, "light", {"rules": {CONTRAST: {"enabled": False}}}),
        ("reference_page", 390, "light", {"rules": {CONTRAST: {"enabled": False}}}),
    ],
)
def test_axe_finds_nothing_serious(browser, request, axe, name, width, scheme, options):
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    open_page(browser, request.getfixturevalue(name), width=width)
    browser.execute_script("document.querySelectorAll('details').forEach(part => { part.open = true; })")
    if name != "page":
        browser.execute_script(THIN)
    browser.execute_script(axe)
    script = """
    const [options, done] = arguments;
    axe.run(document, {...options, resultTypes: ['violations']}).then(found =>
      done(found.violations.map(each => [each.impact, each.id, each.nodes[0].html.slice(0, 200)])));
    """
    assert browser.execute_async_script(script, options) == []
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_in_both_themes(browser, page, scheme):
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    open_page(browser, page, width=1280)
    script = """
    const light = text => {
      const parts = text.match(/[\\d.]+/g).slice(0, 3).map(Number);
      const linear = parts.map(v => v / 255).map(v => v <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4);
      return .2126 * linear[0] + .7152 * linear[1] + .0722 * linear[2];
    };
    const card = light(getComputedStyle(document.querySelector('section')).backgroundColor);
    return ['.lead', '.hint', 'caption', 'td.gain', 'summary'].map(name => {
      const ink = light(getComputedStyle(document.querySelector(name)).color);
      return (Math.max(ink, card) + .05) / (Math.min(ink, card) + .05);
    });
    """
    assert min(browser.execute_script(script)) >= 4.5
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
