"""The page of `shipbench report`, opened and clicked in a real Chromium."""

from __future__ import annotations

import re

import pytest
from chromium import CONTRAST, browse
from hostile import HOSTILE, page_of

from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.reports.study.page import write_report

BOARD = "#d0-board ~ .scroll"
ORDER = f"[...document.querySelector('{BOARD} tbody').rows].map(r => r.cells[1].textContent)"
TRACK, HISTORIES = "document.querySelector('[data-track]')", "document.querySelector('[data-histories]')"
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
    name, track = (
        "document.querySelector('[data-run]').textContent",
        f"JSON.stringify({TRACK}.data.find(t => t.meta === 0).y)",
    )
    shown = f"[{name}, {track}, document.querySelector('[data-cell=\"0-0\"]').textContent]"
    results = browse([
        ["open", page, 1280], ["js", shown], ["click", "#d0 button[data-step='1']"], ["js", shown],
        ["key", "#d0 select", "Home"], ["js", name], ["click", "#d0 input[data-toggle='0']"], ["js", HIDDEN],
        ["click", "#d0 button[data-step='1']"],
        ["js", HIDDEN], ["click", "#d0 button[data-all='1']"], ["js", HIDDEN],
    ])  # fmt: skip
    before, after, first, hidden, still, back = results[1::2]
    assert HOSTILE in before[0]  # as text
    assert all(a != b for a, b in zip(before, after, strict=True))
    assert first.startswith("r0 ")
    assert len(hidden) >= 3  # in the table, both growths and the regimes
    assert not any(hidden)
    assert not any(still)
    assert all(back)


DRAWN = f"[{TRACK}, {HISTORIES}].map(p => p.data.filter(t => t.meta === 0 && t.visible === true).length)"


def test_a_model_switched_off_by_box_or_legend_leaves_track_and_histories(page):
    legend = f"[...{TRACK}.querySelectorAll('.legendtoggle')].forEach((e, i) => e.id = `legend${{i}}`)"
    box = "document.querySelector(\"#d0 input[data-toggle='0']\").checked"
    _, on, _, off, _, again, _, _, gone, boxed = browse([
        ["open", page, 1280], ["js", DRAWN], ["click", "#d0 input[data-toggle='0']"], ["js", DRAWN],
        ["click", "#d0 button[data-all='1']"],
        ["js", DRAWN], ["js", legend], ["click", "#legend1"], ["js", DRAWN], ["js", box],
    ])  # fmt: skip
    assert on[0] == 1
    assert on[1] >= 7  # error, u, v, r, psi, rudder, shaft
    assert off == [0, 0]
    assert again == on
    assert gone == [0, 0]
    assert boxed is False


PANEL = "[data-histories] .nsewdrag[data-subplot='xy2']"
"""The second history: surge speed."""


def test_pointing_at_a_history_shows_time_value_and_unit_and_marks_that_time_on_the_track(page):
    text = "[...document.querySelectorAll('[data-histories] .hoverlayer text')].map(e => e.textContent).join(' ')"
    told, marked = browse(
        [["open", page, 1280], ["hover", PANEL, 0.5, 0.5], ["js", text], ["js", f"{TRACK}.data.at(-1).x.length"]]
    )[2:]
    assert re.search(r"\b15\.0 s\b", told)
    assert re.search(r"measured : -?\d+\.\d{3} m/s", told)
    assert marked >= 2  # measured and at least one model


def test_pointing_at_the_track_shows_time_and_position_and_marks_that_time_in_the_histories(page):
    at = f"""(() => {{ const p = {TRACK}, t = p.data.find((t) => t.meta === 'measured'), a = p._fullLayout;
      const part = (axis, v) => (v - axis.range[0]) / (axis.range[1] - axis.range[0]);
      return [part(a.xaxis, t.x[20]), 1 - part(a.yaxis, t.y[20])]; }})()"""
    x, y = browse([["open", page, 1280], ["js", at]])[1]
    told, line = browse([
        ["open", page, 1280], ["hover", "[data-track] .nsewdrag", x, y],
        ["js", "[...document.querySelectorAll('[data-track] .hoverlayer text')].map(e => e.textContent).join(' ')"],
        ["js", f"({HISTORIES}.layout.shapes ?? []).map((s) => s.x0)"],
    ])[2:]  # fmt: skip
    assert re.search(r"20\.0 s.*east -?[\d.]+ m.*north -?[\d.]+ m", told)
    assert line == [20]


def test_a_zoom_in_time_cuts_the_track_and_a_double_click_shows_the_whole_run(page):
    points, span = f"{TRACK}.data.find(t => t.meta === 'measured').x.length", f"{HISTORIES}.layout.xaxis.range"
    messages, before, _, cut, zoomed, _, after, back, asked, said = browse([
        ["open", page, 1280], ["js", points], ["drag", PANEL, 0.25, 0.5, 0.75, 0.5], ["js", points], ["js", span],
        ["double", PANEL, 0.5, 0.5],
        ["js", points], ["js", span], ["requests"], ["open", page, 390],
    ])  # fmt: skip
    assert messages == said == []  # no error, nothing that the policy refused
    assert before == after == 31
    assert 10 <= cut <= 20
    assert zoomed[0] == pytest.approx(7.5, abs=1.0)
    assert zoomed[1] == pytest.approx(22.5, abs=1.0)
    assert back == [0, 30]
    assert [url for url in asked if not url.startswith(("data:", "blob:"))] == []


def test_tracks_have_the_same_scale_in_both_directions(page):
    scale = (
        f"(() => {{ const a = {TRACK}._fullLayout; return ['xaxis', 'yaxis'].map(n => a[n]._length / "
        "(a[n].range[1] - a[n].range[0])); })()"
    )
    for width in (1280, 390):
        east, north = browse([["open", page, width], ["js", scale]])[1]
        assert east == pytest.approx(north, rel=1e-3)


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_laptop_and_a_phone_light_and_dark(page, width, scheme, tmp_path):
    messages, window, scroll, contrast, saved = browse([
        ["open", page, width], ["js", "innerWidth"],
        ["js", ("[document.documentElement.scrollWidth, "
                "document.documentElement.clientWidth]")],
        ["js", CONTRAST], ["shot", str(tmp_path / "page.png")],
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
    assert browse([["open", page, 1280], asked])[1] == [0, 0, 5, "Study of ship-motion prediction"]


def test_the_band_of_a_model_is_drawn_while_it_is_the_only_one(toy, tmp_path, monkeypatch):
    monkeypatch.setattr("shipbench.bench.runner.load_dataset", lambda name: toy(runs=12))
    file = tmp_path / "models.py"
    file.write_text("from shipbench.predictors.hold import Hold\nclass Other(Hold):\n    pass\n")
    models = ["hold", f"{file}:Other"]
    task = make_task({"dataset": "toy", "models": models, "horizon_s": 20, "folds": 4, "bands": True})
    outcome = run_tasks([task], tmp_path / "out")
    page = str(write_report(outcome.results, tmp_path / "page.html", "shipbench report").path)
    bands = "t => t.meta && t.meta.band !== undefined"
    drawn = f"[{TRACK}, {HISTORIES}].map(box => box.data.filter({bands}).map(t => [t.meta.band, t.visible]))"
    messages, both, _, one, _, again = browse([
        ["open", page, 1280], ["js", drawn], ["click", "#d0 input[data-toggle='1']"], ["js", drawn],
        ["click", "#d0 input[data-toggle='1']"], ["js", drawn],
    ])  # fmt: skip
    assert messages == []
    assert [len(box) for box in both] == [2, 8]  # on the track, and of u, v, r and psi
    assert not any(visible for box in both for _, visible in box)
    assert all(visible == (model == 0) for box in one for model, visible in box)
    assert again == both
