"""The page of a diagnosis, opened and clicked in a real Chromium: a finding, nothing found, and a dependence that no
effect explains."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from chromium import CONTRAST, browse
from made_diagnosis import CAUSE, extended, make_diagnosis

from shipbench.reports.diagnosis.page import diagnosis_page

HOSTILE = "<img src=x onerror='window.alerted=1'>"
TRACK, HISTORIES = "document.querySelector('[data-track]')", "document.querySelector('[data-histories]')"
PANEL = "[data-histories] .nsewdrag[data-subplot='xy2']"
"""The second history: surge speed."""
CUT = """[...document.querySelectorAll('figure svg[role=img]')]
.filter((s) => s.getClientRects().length).flatMap((s) => {
  const b = s.getBoundingClientRect();
  return [...s.querySelectorAll('text')].filter((t) => {
    const c = t.getBoundingClientRect();
    return c.left < b.left - 1 || c.right > b.right + 1 || c.top < b.top - 1 || c.bottom > b.bottom + 1;
  }).map((t) => t.textContent);
})"""
UNFOLD = "document.querySelectorAll('details').forEach((d) => { d.open = true; })"
UNLABELLED = "document.querySelectorAll('figure > svg:not([role=img][aria-label]), .scroll:not([tabindex])').length"
FITS = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """Paths of the pages by verdict; the finding has far positions, a hostile run name and a line that corrects the
    record."""
    found = extended(make_diagnosis())
    trace, force = found.trace, found.trace.force.copy()
    far = {name: getattr(trace, name).copy() for name in ("measured", "before", "after")}
    for states in far.values():
        states[..., :2] += (12_000.0, -34_000.0)
    force[..., 1] += 3e-3
    trace = replace(trace, **far, force=force, force_after=1e-2 * force, names=(HOSTILE, *trace.names[1:]))
    drawn = {
        "found": replace(
            found,
            trace=trace,
            causes=(replace(CAUSE, correction="[scale] u = 1.05 and v = 1.05"),),
            warnings=(HOSTILE,),
        ),
        "none": make_diagnosis("none"),
        "unknown": replace(
            make_diagnosis("unknown"),
            unknown={"axis": "yaw", "variable": "position", "form": "x", "score": 44.0, "share": None},
        ),
    }
    folder, paths = tmp_path_factory.mktemp("diagnosis"), {}
    for verdict, d in drawn.items():
        (folder / f"{verdict}.html").write_text(diagnosis_page(d), encoding="utf-8")
        paths[verdict] = str(folder / f"{verdict}.html")
    return paths


@pytest.mark.parametrize("verdict", ["found", "none", "unknown"])
@pytest.mark.parametrize("width", [1440, 820, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_every_width_in_light_and_dark_and_no_number_is_cut(verdict, width, scheme, pages):
    messages, _, (wide, window), cut, unlabelled, (text, lines, paper) = browse(
        [
            ["open", pages[verdict], width],
            ["js", UNFOLD],
            ["js", FITS],
            ["js", CUT],
            ["js", UNLABELLED],
            ["js", CONTRAST],
        ],
        scheme,
    )
    assert messages == []  # no error, nothing that the policy refused
    assert wide <= window  # tables scroll by themselves, the page does not
    assert cut == []
    assert unlabelled == 0
    assert text >= 4.5  # WCAG AA
    assert lines >= 3.0
    assert (paper < 0.2) == (scheme == "dark")


def test_a_model_switched_off_leaves_plots_and_drawings(pages):
    drawn = f"[{TRACK}, {HISTORIES}].map(p => p.data.filter(t => t.meta === 0 && t.visible === true).length)"
    still = "[...document.querySelectorAll('#compared [data-m=\"0\"]')].filter(e => e.getClientRects().length).length"
    _, on, seen, _, off, unseen, _, again, last = browse([
        ["open", pages["found"], 1280], ["js", drawn], ["js", still], ["click", "input[data-toggle='0']"],
        ["js", drawn], ["js", still],
        ["click", "button[data-all='1']"], ["js", drawn], ["open", pages["found"], 1280],
    ])  # fmt: skip
    assert on[0] == 1
    assert on[1] == 5  # error, u, v, r, psi: rudder and shaft speed are not predicted
    assert seen > 5  # table of errors, growth, gain per run, slices
    assert off == [0, 0]
    assert unseen == 0
    assert again == on
    assert last == []


def test_pointing_at_a_history_shows_time_value_and_unit_and_marks_that_time_on_the_track(pages):
    text = "[...document.querySelectorAll('[data-histories] .hoverlayer text')].map(e => e.textContent).join(' ')"
    shown, marked = browse(
        [
            ["open", pages["found"], 1280],
            ["hover", PANEL, 0.5, 0.5],
            ["js", text],
            ["js", f"{TRACK}.data.at(-1).x.length"],
        ]
    )[2:]
    assert re.search(r"\b30\.0 s\b", shown)
    assert all(
        re.search(rf"{name} : -?\d+\.\d{{3}} m/s", shown) for name in ("measured", "calibrated ship", "extended model")
    )
    assert marked == 3


def test_a_zoom_in_time_cuts_the_track_and_a_double_click_shows_the_whole_run(pages):
    points = f"{TRACK}.data.find(t => t.meta === 'measured').x.length"
    _, before, _, cut, _, after, asked, messages = browse([
        ["open", pages["found"], 1280], ["js", points], ["drag", PANEL, 0.25, 0.5, 0.75, 0.5], ["js", points],
        ["double", PANEL, 0.5, 0.5],
        ["js", points], ["requests"], ["open", pages["found"], 390],
    ])  # fmt: skip
    assert before == after == 61
    assert 25 <= cut <= 35
    assert [url for url in asked if not url.startswith(("data:", "blob:"))] == []
    assert messages == []


def test_names_are_text_and_the_correction_is_copied_as_lines(pages):
    name = (
        "[...document.querySelectorAll('select option')].some(o => "
        f"o.textContent.startsWith({HOSTILE!r}.replaceAll('\\\\', '')))"
    )
    copied = "document.querySelector('.aside pre').textContent"
    _, alerted, named, _, lines = browse([
        ["open", pages["found"], 1280], ["js", "[window.alerted ?? 0, document.images.length]"], ["js", name],
        ["click", ".aside button.copy"],
        ["js", copied],
    ])  # fmt: skip
    assert alerted == [0, 0]
    assert named
    assert lines == "[scale]\nu = 1.05\nv = 1.05"


def test_the_separating_trial_stands_beside_its_cause_and_below_it_on_a_phone(pages):
    places = (
        "['.cause dl', '.cause .aside'].map(s => { const b = "
        "document.querySelector(s).getBoundingClientRect(); return [b.left, b.top]; })"
    )
    for width, beside in ((1440, True), (390, False)):
        (left, top), (trial_left, trial_top) = browse([["open", pages["found"], width], ["js", places]])[1]
        assert (trial_left > left + 200) == beside
        assert (trial_top > top + 50) == (not beside)
