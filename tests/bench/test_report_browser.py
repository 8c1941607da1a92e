"""The page of `shipbench report`, opened and clicked in a real Chromium."""

from __future__ import annotations

import pytest
from chromium import browse
from test_report_page import HOSTILE, page_of, study

__all__ = ["study"]

BOARD = "#d0-board ~ .scroll"
ORDER = f"[...document.querySelector('{BOARD} tbody').rows].map(r => r.cells[1].textContent)"
HIDDEN = "[...document.querySelectorAll('#d0 [data-m=\"0\"]')].map(e => e.getClientRects().length)"


@pytest.fixture(scope="session")
def page(study, tmp_path_factory):
    return str(page_of(study, tmp_path_factory.mktemp("page")).path)


def test_a_click_on_a_column_head_sorts_and_a_second_one_turns_it_round(page):
    head = f"{BOARD} thead th:nth-child(4)"
    values = f"[...document.querySelector('{BOARD} tbody').rows].map(r => r.cells[3].dataset.by)"
    _, _, up, _, down, said, _, by_key = browse([
        ["open", page, 1280], ["click", f"{head} button"], ["js", values], ["click", f"{head} button"], ["js", values],
        ["js", f"document.querySelector('{head}').getAttribute('aria-sort')"],
        ["key", f"{BOARD} thead th:nth-child(2) button", "Space"], ["js", ORDER],
    ])  # fmt: skip
    known = [float(v) for v in up if v]
    assert len(known) == 3  # Fails has no score and stays last
    assert [v for v in up if not v] == up[len(known) :]
    assert known == sorted(known)
    assert [float(v) for v in down if v] == known[::-1]
    assert down[-1] == ""
    assert said == "descending"
    assert by_key == sorted(by_key, key=str.lower)


def test_another_run_and_other_models_can_be_chosen(page):
    name, picture = "document.querySelector('[data-run]').textContent", "document.querySelector('[data-stage] svg').innerHTML"
    shown = f"[{name}, {picture}, document.querySelector('[data-error=\"0\"]').textContent]"
    results = browse([
        ["open", page, 1280], ["js", shown], ["click", "#d0 button[data-step='1']"], ["js", shown],
        ["key", "#d0 select", "Home"], ["js", name], ["click", "#d0 input[data-toggle='0']"], ["js", HIDDEN], ["click", "#d0 button[data-step='1']"],
        ["js", HIDDEN], ["click", "#d0 button[data-all='1']"], ["js", HIDDEN],
    ])  # fmt: skip
    before, after, first, hidden, still, back = results[1::2]
    assert HOSTILE in before[0]  # as text
    assert all(a != b for a, b in zip(before, after, strict=True))
    assert first.startswith("r0 ")
    assert len(hidden) > 5  # in the track, the table, both growths and the regimes
    assert not any(hidden)
    assert not any(still)
    assert all(back)


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_laptop_and_a_phone_light_and_dark(page, width, scheme, tmp_path):
    colours = """(() => {
      const lum = (c) => { const [r, g, b] = c.match(/[\\d.]+/g).slice(0, 3)
          .map((v) => v / 255).map((v) => v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4);
        return .2126 * r + .7152 * g + .0722 * b; };
      const paper = lum(getComputedStyle(document.body).backgroundColor);
      const ratio = (c) => { const l = lum(c); return (Math.max(l, paper) + .05) / (Math.min(l, paper) + .05); };
      const of = (s, what) => [...document.querySelectorAll(s)].map((e) => ratio(getComputedStyle(e)[what]));
      return [Math.min(...of('p, td, th, a, .small, figcaption, summary', 'color')), Math.min(...of('.line', 'stroke')), paper];
    })()"""
    messages, window, scroll, contrast, saved = browse([
        ["open", page, width], ["js", "innerWidth"], ["js", "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"],
        ["js", colours], ["shot", str(tmp_path / "page.png")],
    ], scheme)  # fmt: skip
    assert messages == []  # no error, nothing refused
    assert window == width
    assert scroll[0] <= scroll[1]  # tables scroll by themselves, the page does not
    text, lines, paper = contrast
    assert text >= 4.5  # WCAG AA
    assert lines >= 3.0
    assert (paper < 0.2) == (scheme == "dark")
    assert saved
    assert (tmp_path / "page.png").stat().st_size > 10_000


def test_nothing_of_a_hostile_name_runs(page):
    asked = ["js", "[window.alerted ?? 0, document.images.length, document.scripts.length, document.title]"]
    assert browse([["open", page, 1280], asked])[1] == [0, 0, 2, "Report: toy"]
