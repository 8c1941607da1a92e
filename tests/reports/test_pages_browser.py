"""The pages of `data describe --out` and `leaderboard --format html`, opened and clicked in a real Chromium."""

from __future__ import annotations

import re

import pytest
from chromium import CONTRAST, browse
from hostile import HOSTILE, card_of

from shipbench.bench.submissions import read_results
from shipbench.leaderboard.pages import write_boards

TRACK, HISTORIES = "document.querySelector('[data-track]')", "document.querySelector('[data-histories]')"
FITS = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"


@pytest.fixture(scope="session")
def card(tmp_path_factory):
    return str(card_of(tmp_path_factory.mktemp("card")))


@pytest.fixture(scope="session")
def board(study, tmp_path_factory):
    """A leaderboard with tracks, of four models on runs with hostile names."""
    [(_, page)] = write_boards(
        read_results([study]), tmp_path_factory.mktemp("board"), f"shipbench leaderboard {HOSTILE}", formats=["html"]
    )
    return str(page)


@pytest.fixture(scope="session")
def tables(study, tmp_path_factory):
    """The same without plots."""
    found = write_boards(
        read_results([study]), tmp_path_factory.mktemp("tables"), "shipbench leaderboard", plots=False, formats=["html"]
    )
    return str(found[0][1])


@pytest.mark.parametrize("name", ["card", "board", "tables"])
@pytest.mark.parametrize("width", [1440, 820, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_every_width_in_light_and_dark(name, width, scheme, request, tmp_path):
    page = request.getfixturevalue(name)
    messages, (wide, window), (text, _, paper), saved = browse(
        [["open", page, width], ["js", FITS], ["js", CONTRAST], ["shot", str(tmp_path / "page.png")]], scheme
    )
    assert messages == []  # no error, nothing that the policy refused
    assert wide <= window  # tables scroll by themselves, the page does not
    assert text >= 4.5  # WCAG AA
    assert (paper < 0.2) == (scheme == "dark")
    assert saved


@pytest.mark.parametrize("name", ["card", "board", "tables"])
def test_nothing_of_a_hostile_name_runs_and_nothing_is_asked_of_a_network(name, request):
    page = request.getfixturevalue(name)
    _, (alerted, images), asked = browse(
        [["open", page, 1280], ["js", "[window.alerted ?? 0, document.images.length]"], ["requests"]]
    )
    assert (alerted, images) == (0, 0)
    assert [url for url in asked if not url.startswith(("data:", "blob:"))] == []


def test_runs_of_a_card_are_chosen_and_read_off(card):
    name = "document.querySelector('[data-run]').textContent"
    text = "[...document.querySelectorAll('[data-histories] .hoverlayer text')].map(e => e.textContent).join(' ')"
    _, first, _, second, _, told, marked = browse([
        ["open", card, 1280], ["js", name], ["click", "button[data-step='1']"], ["js", name],
        ["hover", "[data-histories] .nsewdrag[data-subplot='xy']", 0.5, 0.5], ["js", text],
        ["js", f"{TRACK}.data.at(-1).x.length"],
    ])  # fmt: skip
    assert HOSTILE in first  # as text
    assert first != second
    assert re.search(r"recorded : -?\d+\.\d{3} m/s", told)
    assert marked == 1


def test_what_cannot_be_identified_folds_on_a_phone_and_is_a_table_elsewhere(card):
    shown = "getComputedStyle(document.querySelector('#gaps thead')).display"
    assert browse([["open", card, 390], ["js", shown], ["open", card, 820], ["js", shown]])[1::2] == [
        "none",
        "table-header-group",
    ]


def test_a_click_sorts_a_leaderboard_and_every_name_and_interval_is_in_sight(board):
    table = "document.querySelector('#t0 ~ .scroll table')"
    values = f"[...{table}.tBodies[0].rows].map(r => r.cells[4].dataset.by)"
    head = "#t0 ~ .scroll thead th:nth-child(5) button"
    names = f"[...{table}.querySelectorAll('th.model[scope=row]')].map(e => e.textContent)"
    strips = (
        "[...document.querySelectorAll('#intervals .strip .dot')].map(e => e.getBoundingClientRect()).map(b => "
        "[b.left, b.right])"
    )
    _, _, up, _, down, shown, dots = browse([
        ["open", board, 390], ["click", head], ["js", values], ["click", head], ["js", values], ["js", names],
        ["js", strips],
    ])  # fmt: skip
    known = [float(v) for v in up if v]
    assert known == sorted(known)
    assert [float(v) for v in down if v] == known[::-1]
    assert {name.split("/")[-1] for name in shown} >= {"hold", "m.py:Still", "m.py:Fails", "m.py:Blows"}
    assert len(dots) >= 6
    assert all(0 <= left < right <= 390 for left, right in dots)


def test_a_model_switched_off_leaves_the_curves_of_a_leaderboard(board):
    drawn = f"[{TRACK}, {HISTORIES}].map(p => p.data.filter(t => t.meta === 0 && t.visible === true).length)"
    _, on, _, off = browse([["open", board, 1280], ["js", drawn], ["click", "input[data-toggle='0']"], ["js", drawn]])
    assert all(on)
    assert off == [0, 0]
