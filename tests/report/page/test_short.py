"""The 30-second test of `docs/report.md`, how long a page may be, phones, and the row chooser, in a browser."""

import pytest
from support.browser import open_page

SCREEN = {"width": 1280, "height": 800}
MOST_SCREENS, MOST_WORDS = 12, 3500
"""Outside of what is folded, for the reference run."""
NOT_HERE_SCREENS = 1.25
"""What that run shows besides: pictures of cameras above its grids, a second target, longer names."""
MOST_BYTES = 3_000_000


def test_who_wins_by_how_much_and_how_sure_stands_on_the_first_screen(browser, reference_page):
    open_page(browser, reference_page, **SCREEN)
    shown = "#summary .lead, #summary .tiles li, #summary > .hint"
    script = "return [...document.querySelectorAll(arguments[0])].map(e => " + (
        "[e.textContent.trim(), e.getBoundingClientRect().bottom])"
    )
    parts = browser.execute_script(script, shown)
    assert max(bottom for _, bottom in parts) <= SCREEN["height"]
    text = " ".join(words for words, _ in parts)
    assert (
        "Like for like (2 inputs, sensor front, 0.29 s ahead; 6 rows), RN-DC has the highest mean IoU of known classes"
        in text
    )
    assert "Of all 26 rows with these targets, RN-SL5 is best" in text
    assert "It differs in what it is given or asked: 5 inputs instead of 2 inputs." in text
    assert text.count("95% interval") == 2
    assert "6 windows from 6 recordings and 1 seed for each trained row" in text
    assert sum(" to " in words for words, _ in parts[-6:-1]) == 5  # each tile has its interval
    assert "known are all but unknown" in parts[-1][0]
    assert "Vehicles: car, large vehicle; Small dynamic: person, bicycle." in parts[-1][0]


def test_the_page_of_a_reference_run_is_short(browser, reference_page):
    open_page(browser, reference_page, **SCREEN)
    high, text = browser.execute_script("return [document.documentElement.scrollHeight, document.body.innerText]")
    assert high <= (MOST_SCREENS - NOT_HERE_SCREENS) * SCREEN["height"]
    assert 500 < len(text.split()) <= MOST_WORDS
    assert reference_page.stat().st_size < MOST_BYTES


@pytest.mark.parametrize("name", ["reference_page", "side_by_side"])
def test_no_table_is_cut_on_a_phone_without_a_hint(browser, request, name):
    open_page(browser, request.getfixturevalue(name), width=390)
    script = """
    document.querySelectorAll('details').forEach(part => { part.open = true; });
    const done = arguments[0];
    requestAnimationFrame(() => setTimeout(() => done([...document.querySelectorAll('.scroll')].map(each => [
      each.scrollWidth > each.clientWidth,
      getComputedStyle(each.parentElement.querySelector('.tip'), '::before').content.includes('right')])), 100));
    """
    found = browser.execute_async_script(script)
    assert all(cut == hinted for cut, hinted in found)
    assert any(cut for cut, _ in found)
    wide = "const chart = document.querySelector('.chart'); return [chart.scrollWidth, chart.parentElement.clientWidth]"
    chart, room = browser.execute_script(wide)
    assert chart <= room


def _shown(browser, table):
    return _seen(browser, f"{table} tr:not(.asked) th[scope=row] .name")


def _seen(browser, parts):
    script = (
        "return [...document.querySelectorAll(arguments[0])].filter(e => e.offsetParent).map(e => e.innerText.trim())"
    )
    return browser.execute_script(script, parts)


UNCHECK = """
const box = [...document.querySelectorAll('.chooser input')].find(each => each.value === arguments[0]);
box.checked = false;
box.dispatchEvent(new Event('input', {bubbles: true}));
return location.hash;
"""


def test_what_is_chosen_holds_for_tables_and_figures_and_is_part_of_the_address(browser, reference_page):
    open_page(browser, reference_page, width=1280, end="#scores")
    browser.execute_script(UNCHECK, "ED")
    address = browser.execute_script(UNCHECK, "0.59 s ahead")
    assert address.startswith("#scores&families=")
    chart, table = _shown(browser, "#chart"), _shown(browser, "#table-categories")
    assert sorted(chart) == sorted(table)
    assert not any(name.startswith("ED") or name.endswith("PH1") for name in chart)
    assert {"BL-DC", "RN-SL5", "ceiling-PH2"} <= set(chart)
    open_page(browser, reference_page, width=1280, end=address)
    assert _shown(browser, "#chart") == chart
    drawn = """
    document.querySelectorAll('details').forEach(part => { part.open = true; });
    const parts = [...document.querySelectorAll('svg [data-row]')];
    return [parts.length, parts.filter(part => getComputedStyle(part).display === 'none').length];
    """
    parts, hidden = browser.execute_script(drawn)
    assert 0 < hidden < parts
    played = _seen(browser, ".strip:first-child span")
    assert played[:2] == ["Newest input", "Target"]
    assert len(played) > 2
    answers = _seen(browser, ".answers figcaption .name")
    assert answers
    assert not any(name.startswith("ED") for name in [*played, *answers])
    assert "of 34" in browser.execute_script("return document.querySelector('.chooser output').value")


def test_tables_figures_and_claims_of_which_no_row_is_left_are_left_out(browser, reference_page):
    open_page(browser, reference_page, width=1280, end="#rows&families=RN")
    browser.execute_script("document.querySelectorAll('details').forEach(part => { part.open = true; });")
    confusions = _seen(browser, "[id^=caption-confusion]")
    assert confusions
    assert all(caption.startswith("RN") for caption in confusions)
    empty = """
    return [...document.querySelectorAll('main .table, main .plot')].filter(part => part.offsetParent).filter(part => {
      const rows = [...part.querySelectorAll('[data-row]')];
      return rows.length && rows.every(row => getComputedStyle(row).display === 'none');
    }).length;
    """
    assert browser.execute_script(empty) == 0
    claims = _seen(browser, "#table-findings tbody tr:first-child .name")
    assert claims
    assert all("RN" in claim for claim in claims), claims


def test_rows_are_found_by_their_names_and_all_come_back(browser, reference_page):
    open_page(browser, reference_page, width=1280, end="#&names=sp2%2C+rn-nt")
    assert _shown(browser, "#chart") == ["RN-NT", "BL-Sp2", "ED-Sp2", "RN-Sp2"]
    browser.execute_script("document.querySelector('.chooser button').click()")
    browser.execute_async_script("setTimeout(arguments[0], 50)")
    assert len(_shown(browser, "#chart")) == 33
    assert browser.execute_script("return location.hash") in ("", "#")


def test_a_link_to_a_section_keeps_what_was_chosen(browser, reference_page):
    open_page(browser, reference_page, width=1280, end="#rows&families=RN")
    browser.execute_script("document.querySelector('nav a[href=\"#scores\"]').click()")
    browser.execute_async_script("setTimeout(arguments[0], 50)")
    assert browser.execute_script("return location.hash") == "#scores&families=RN"
    assert all(name.startswith("RN") for name in _shown(browser, "#table-categories"))
