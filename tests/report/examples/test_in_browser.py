"""Examples with camera images in headless Chromium, driven by Selenium; skipped where either is missing."""

import pytest
from support.browser import open_page

pytestmark = pytest.mark.slow

OPEN_ALL = "document.querySelectorAll('details').forEach(part => { part.open = true; });"


def show(browser, page, *, width=1280):
    open_page(browser, page, width=width)
    browser.execute_script(OPEN_ALL)


@pytest.fixture(scope="module")
def opened(browser, seen_page):
    show(browser, seen_page)
    return browser


def test_every_picture_is_decoded_and_nothing_goes_wrong(opened):
    script = """
    const done = arguments[0], pictures = [...document.querySelectorAll('#examples img')];
    Promise.all(pictures.map(picture => picture.decode().catch(() => null)))
      .then(() => done(pictures.map(picture => [picture.naturalWidth, picture.src.slice(5, 15), picture.alt])));
    """
    found = opened.execute_async_script(script)
    assert len(found) > 100
    assert all(width > 0 and alt for width, _, alt in found)
    assert {kind for _, kind, _ in found} == {"image/webp", "image/png;"}
    assert opened.get_log("browser") == []


def test_the_slider_moves_camera_segmentation_and_grid_together(opened):
    script = """
    const sources = (part, chosen) => [...part.querySelectorAll(chosen)].map(each => each.src);
    const views = document.querySelector('.views'), flip = views.querySelector('.flip');
    const slider = flip.querySelector('input'), seen = [];
    for (let step = 0; step <= slider.max; step++) {
      slider.value = step;
      slider.dispatchEvent(new Event('input'));
      const texts = [flip.querySelector('output').value, slider.getAttribute('aria-valuetext')];
      seen.push([...texts, ...sources(flip, 'span:not([hidden]) img')]);
    }
    const film = [...views.querySelectorAll('.film figure')].map(each => sources(each, 'img'));
    return [seen, film, views.querySelector('.answers img').src];
    """
    seen, film, prediction = opened.execute_script(script)
    assert [step[0] for step in seen] == ["Input 1 of 2", "Input 2 of 2", "Target", "own-DC"]
    assert seen[0][1] == "Input 1 of 2 0.235 s before the target"
    assert [step[2:] for step in seen[:3]] == film
    assert seen[3][2:] == [*film[2][:2], prediction], "a prediction is shown with what the camera saw at its time"


def test_steps_with_fewer_grids_hide_the_others(opened):
    script = """
    const flip = [...document.querySelectorAll('.hatched .flip')][0], slider = flip.querySelector('input');
    return [0, 2, 3].map(step => {
      slider.value = step;
      slider.dispatchEvent(new Event('input'));
      return [...flip.querySelectorAll('.map')].map(each => each.getBoundingClientRect().width > 0);
    });
    """
    assert opened.execute_script(script) == [[True, True], [True, False], [True, False]]


def test_the_blind_band_lies_over_the_grids_of_two_sensors_alone(opened):
    script = """
    const overlay = each => getComputedStyle(each, '::after').backgroundImage.slice(0, 26);
    const kinds = chosen => [...new Set([...document.querySelectorAll(chosen)].map(overlay))];
    return [kinds('.hatched .map'), kinds('.views:not(.hatched) .map'), document.querySelectorAll('.hatched').length];
    """
    hatched, others, count = opened.execute_script(script)
    assert hatched == ['url("data:image/png;base64']
    assert others == ["none"]
    assert count == 2
    names = (
        "return [...document.querySelector('.hatched .flip .photo').querySelectorAll('.crop')].map(e => e.textContent)"
    )
    assert opened.execute_script(names) == ["split2_upper", "split2_lower"]


def test_sensors_are_framed_within_the_camera_image(opened):
    script = """
    const photo = document.querySelector('.hatched .photo'), outer = photo.querySelector('img').getBoundingClientRect();
    return [...photo.querySelectorAll('.crop')].map(each => {
      const inner = each.getBoundingClientRect();
      return [(inner.top - outer.top) / outer.height, (inner.bottom - outer.top) / outer.height];
    });
    """
    upper, lower = opened.execute_script(script)
    assert upper == pytest.approx([0, 125 / 256], abs=0.02)
    assert lower == pytest.approx([145 / 256, 1], abs=0.02)


@pytest.mark.parametrize("width", [390, 820, 1280])
def test_nothing_scrolls_sideways_or_leaves_its_column(browser, seen_page, width):
    show(browser, seen_page, width=width)
    wide, shown = browser.execute_script(
        "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    )
    assert wide <= shown <= width
    script = """
    const right = each => each.getBoundingClientRect().right;
    const parts = [...document.querySelectorAll('#examples .window *')];
    return Math.max(...parts.map(right)) - right(document.querySelector('#examples'));
    """
    assert browser.execute_script(script) <= 0


def test_colours_of_segmentation_and_grids_switch_together(browser, seen_page):
    show(browser, seen_page)
    script = "return ['.labels', '.map', '.photo'].map(kind => document.querySelector(`.film ${kind} img`).src)"
    before = browser.execute_script(script)
    browser.execute_script("document.querySelector('.colours').click()")
    after = browser.execute_script(script)
    assert [old != new for old, new in zip(before, after, strict=True)] == [True, True, False]


PLACE = "getComputedStyle(reel.querySelector('img')).objectPosition"


def _with_motion(browser, wanted):
    features = [{"name": "prefers-reduced-motion", "value": wanted}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


def test_the_grid_of_examples_stands_still_for_who_wants_no_motion_and_steps_by_hand(browser, reference_page):
    _with_motion(browser, "reduce")
    open_page(browser, reference_page, width=1280)
    script = f"""
    const done = arguments[0], reel = document.querySelector('.reel'), slider = reel.querySelector('input');
    reel.scrollIntoView();
    const [said, button] = ['output', 'button'].map(kind => reel.querySelector(kind));
    const state = () => [slider.value, said.value, button.textContent, {PLACE}];
    setTimeout(() => {{
      const seen = [state()];
      for (let at = 0; at <= slider.max; at++) {{
        slider.value = at;
        slider.dispatchEvent(new Event('input'));
        seen.push(state());
      }}
      done(seen);
    }}, 600);
    """
    before, *steps = browser.execute_async_script(script)
    assert before == steps[-1] == ["3", "0.29 s ahead", "Play", "100% 0px"]
    assert [step[1] for step in steps] == ["1.18 s ahead", "0.88 s ahead", "0.59 s ahead", "0.29 s ahead"]
    assert [float(step[3].split("%")[0]) for step in steps] == pytest.approx([0, 100 / 3, 200 / 3, 100], abs=0.01)


def test_the_grid_of_examples_plays_once_when_it_is_seen_and_again_when_asked(browser, reference_page):
    _with_motion(browser, "no-preference")
    open_page(browser, reference_page, width=1280)
    script = """
    const done = arguments[0], reel = document.querySelector('.reel'), button = reel.querySelector('button');
    const seen = [], until = (word, then) => {
      const look = setInterval(() => { if (button.textContent === word) { clearInterval(look); then(); } }, 20);
    };
    reel.scrollIntoView();
    until('Stop', () => until('Play', () => {
      seen.push(reel.querySelector('input').value);
      button.click();
      seen.push(button.textContent, reel.querySelector('input').value);
      button.click();
      seen.push(button.textContent);
      done(seen);
    }));
    """
    assert browser.execute_async_script(script) == ["3", "Stop", "0", "Play"]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
