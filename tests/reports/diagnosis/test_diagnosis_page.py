"""The report holds what the diagnosis holds, and needs no network."""

from __future__ import annotations

import html
import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from made_diagnosis import CANDIDATES, CAUSE, GAIN, extended, make_diagnosis, make_trace
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.diagnosis.result import Calibrated, Candidate, Diagnosis, Estimate, Gain, Moved, NoiseFloor
from shipbench.reports.diagnosis.files import write_diagnosis, write_report
from shipbench.reports.diagnosis.linked import changed, chosen_segments, fits, position_errors
from shipbench.reports.diagnosis.page import _mean_error, diagnosis_page
from shipbench.reports.diagnosis.page import diagnosis_page as page
from shipbench.reports.diagnosis.summary import summary_lines
from shipbench.reports.diagnosis.text import WIDTH, gain_words, headline


def in_words(d: Diagnosis) -> Diagnosis:
    """Without the pictures, which take seconds."""
    return replace(d, trace=None, gain_per_run=())


@pytest.fixture(scope="session", params=["found", "none", "unknown"])
def written(request, tmp_path_factory):
    """A verdict, and the folder that its diagnosis was written to."""
    folder = tmp_path_factory.mktemp(request.param)
    write_diagnosis(make_diagnosis(request.param), folder)
    return request.param, folder


def test_the_page_stands_alone_and_names_every_candidate(written):
    verdict, folder = written
    text = (folder / "report.html").read_text()
    assert not re.search(
        r"(src|href)=.https?:|@import|url\(http", re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    )
    assert all(c.effect in text for c in CANDIDATES)
    assert "prefers-color-scheme" in text
    assert len(text) < 5e6
    assert ("Gain per run" in text) == (verdict == "found")
    assert not list(folder.glob(".*"))


def test_names_from_the_data_are_escaped(tmp_path):
    write_diagnosis(in_words(make_diagnosis(name="<script>alert(1)</script>")), tmp_path)
    text = (tmp_path / "report.html").read_text()
    assert "<script>alert" not in text
    assert "&lt;script&gt;" in text


def test_the_document_has_the_contracts_keys_and_no_nan(tmp_path):
    write_diagnosis(in_words(make_diagnosis()), tmp_path)
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    keys = {"schema", "dataset", "base_model", "verdict", "causes", "candidates", "what_is_wrong", "unexplained_after",
        "extended_model",
            "fingerprint", "seconds"}  # fmt: skip
    assert keys <= set(document)
    turn = Moved("yaw rate", 0.444, "1", (0.4, 0.493), 0.7)
    own = Calibrated(15.7, 0.467, (0.25, 0.83), 120.0, True, (turn,))
    assert in_words(replace(make_diagnosis(), calibration=own)).document()["calibration"] == {
        "metric": "ED", "on": "held-out runs", "before": 15.7, "after": 0.467, "ci95": [0.25, 0.83], "seconds": 120.0,
        "moved": [{"coefficient": "yaw rate", "change": 0.444, "unit": "1", "ci95": [0.4, 0.493], "spreads": 0.7}],
        "noise_floor": None,
    }  # fmt: skip
    floored = replace(own, noise_floor=NoiseFloor(0.31, 0.0123456789))
    written = in_words(replace(make_diagnosis(), calibration=floored)).document()["calibration"]
    assert written["noise_floor"] == {"position": 0.31, "heading": 0.0123457}
    assert document["schema"] == 1
    cause = document["causes"][0]
    assert cause["parameters"]["speed"] == {"value": 0.31, "unit": "m/s", "ci95": [0.28, 0.34]}
    assert cause["gain"]["runs_better"] == "24/24"
    assert cause["in_words"] == "a current of 0.31 m/s towards 143°"
    assert cause["force"] == {"sway": 38123.0, "yaw": 1.2e6}
    assert document["candidates"][1]["score"] is None
    assert document["candidates"][0]["rejected_because"] == "named"


def test_the_summary_says_the_verdict_with_sizes_and_the_next_command():
    lines = summary_lines(make_diagnosis())
    text = " ".join("\n".join(lines).split())  # whatever the lines are broken at
    assert max(map(len, lines)) <= WIDTH + 2
    assert "current" in text
    assert "to 143° (95 %: 138° to 149°)" in text
    assert "falls from 21.3 m to 9.80 m: 54 % less (95 %: 40 to 66 %)" in text
    assert "better in 24 of 24 runs" in text
    assert "Found: a current of 0.31 m/s towards 143°. With it, the position error of the calibrated ship" in text
    assert "Its force is up to 38 kN sideways and 1.2 MN m in yaw on these runs." in text
    assert "Naming it removes 11.5 m of 21.3 m position error on held-out runs." in text
    assert "shipbench run --model physics --model calibrated --model calibrated+current" in text
    assert "reciprocal courses" in text
    assert "WARNING: few runs" in text


@pytest.mark.parametrize("spec", ["{folder}", "calm[seed=3]"])
def test_the_commands_name_the_data_as_the_user_did(spec, toy, tmp_path, monkeypatch):
    """A folder's data set has a name of its own, and one with parameters is not found without them."""
    spec = spec.format(folder=tmp_path / "my trial")
    loaded = []
    monkeypatch.setattr(  # first: what it imports takes the true load_dataset
        "shipbench.diagnosis.diagnose.diagnose", lambda data, **options: in_words(make_diagnosis(name=data.name))
    )
    monkeypatch.setattr(
        "shipbench.data.base.load_dataset", lambda given: loaded.append(given) or toy(runs=1, name="bridge")
    )
    result = CliRunner().invoke(app, ["diagnose", spec, "--out", str(tmp_path / "out")])
    assert loaded == [spec]
    assert f"--model calibrated+current --dataset {shlex.quote(spec)}" in " ".join(
        result.stdout.replace("\\\n", "").split()
    )  # broken for a shell
    page = html.unescape((tmp_path / "out/report.html").read_text())
    assert f"--model calibrated+current --dataset {shlex.quote(spec)}<" in page
    assert f"shipbench diagnose {shlex.quote(spec)}<" in page


def test_a_size_without_interval_is_written_without_one():
    from shipbench.reports.diagnosis.text import interval

    assert interval(Estimate(1317.0, "m", (float("nan"), float("nan")))) == "1317 m"
    assert interval(Estimate(0.31, "m/s", (0.28, 0.34))) == "0.310 m/s (95 %: 0.280 to 0.340)"


def test_none_comes_with_the_sizes_that_would_have_been_seen():
    text = "\n".join(summary_lines(replace(make_diagnosis("none"), warnings=())))
    assert "Nothing found" in text
    assert "0.115 deg" in text
    assert "physics+" not in text


@pytest.mark.parametrize(
    ("axis", "variable", "form", "told"),
    [
        ("sway and yaw", "nothing", "constant", "a constant force in sway and yaw"),
        ("recorded surge", "nothing", "constant", "a constant error of the recorded surge"),
        ("recorded heading", "time", "t", "an error of the recorded heading that depends on time, best as t"),
    ],
)
def test_unknown_tells_a_force_from_an_error_of_a_sensor(axis, variable, form, told):
    d = replace(
        in_words(make_diagnosis("unknown")),
        unknown={"axis": axis, "variable": variable, "form": form, "score": 44.0, "share": None},
    )
    assert told in headline(d)
    assert told in page(d)


def test_what_follows_the_place_is_drawn_over_the_places():
    """Its axes alone: what else is missing follows something else."""
    unknown = {"axis": "yaw and sway", "variable": "position", "form": "a x + b y", "score": 44.0, "share": None}
    drawn, other = (
        page(replace(make_diagnosis("unknown"), unknown=u)) for u in (unknown, unknown | {"variable": "heading"})
    )
    assert [f"Missing {axis} force over the places" in drawn for axis in ("surge", "sway", "yaw")] == [
        False,
        True,
        True,
    ]
    assert "over the places" not in other


def test_an_effect_that_no_possible_size_shows_has_a_line_without_one():
    seen, never = (
        Candidate(e, 1.0, 0.9, "below", {}, {"gain": v}, {"gain": "1"}, "rudder")
        for e, v in (("one", 0.3), ("other", np.nan))
    )
    lines = summary_lines(
        replace(make_diagnosis("none"), candidates=(seen, never, Candidate("third", 1.0, 0.9, "below")))
    )
    at = next(i for i, line in enumerate(lines) if line.startswith("Detection limit"))
    assert [line.split() for line in lines[at + 2 : at + 5]] == [["one", "gain", "0.300"], ["other", "-"], []]


def test_unknown_names_axis_and_variable():
    text = " ".join("\n".join(summary_lines(make_diagnosis("unknown"))).split())
    assert "a force in yaw that depends on heading, best as cos(3 psi + phase)" in text


def test_infinite_scores_do_not_reach_the_json(tmp_path):
    d = in_words(make_diagnosis())
    write_diagnosis(replace(d, causes=(replace(CAUSE, score=np.inf),)), tmp_path)
    assert json.loads((tmp_path / "diagnosis.json").read_text())["causes"][0]["score"] is None


def test_the_page_tells_why_each_candidate_was_rejected_and_what_would_have_been_seen(written):
    verdict, folder = written
    text = (folder / "report.html").read_text()
    assert all(c.rejected_because in text for c in CANDIDATES)
    assert "0.115 deg" in text
    assert "north 0.0500 m/s" in text
    assert ("A trial that can:</b> Reciprocal courses." in text) == (verdict == "found")


def test_only_an_extended_model_is_drawn_beside_the_plain_one():
    plain, better = make_diagnosis(), extended(make_diagnosis())
    assert not changed(plain)
    assert changed(better)
    shown, alone = page(better), page(plain)
    assert "extended model</label>" in shown
    assert "extended model</label>" not in alone


def test_runs_are_shown_from_the_greatest_error_to_the_least_and_hold_the_one_that_gains_least():
    trace = make_trace(40)
    trace.before[..., 0] += np.arange(40.0)[:, None]
    after = trace.measured + 0.0
    after[17] = trace.before[17] + 1.0
    trace = replace(trace, after=after)
    chosen = chosen_segments(trace, True)
    assert len(chosen) <= 24
    assert chosen == sorted(chosen, reverse=True)
    assert {0, 17, 39} <= set(chosen)
    assert chosen_segments(make_trace(4), False) == [0, 1, 2, 3]


def test_errors_leave_out_the_given_sample():
    trace = make_trace()
    off = trace.measured.copy()
    off[:, 1:, 0] += 3.0
    assert position_errors(trace, off) == pytest.approx(3.0)


def test_a_prediction_without_a_position_has_no_mean_error_of_the_rest():
    trace = make_trace()
    lost = trace.measured.copy()
    lost[0, 5:] = np.nan
    errors = position_errors(trace, lost)
    assert np.isinf(errors[0])
    assert errors[1] == pytest.approx(0.0)
    assert _mean_error(errors) == f"lost in 1 of {len(errors)} predictions"
    assert chosen_segments(replace(trace, before=lost), False)[0] == 0


def test_fits_leave_out_the_given_sample_and_what_is_not_measured():
    measured = make_trace(1).measured[0]
    measured[:, 4] = np.nan
    found = fits(measured, np.where(np.arange(len(measured))[:, None] == 0, 99.0, measured))
    assert found[[0, 2, 3, 5]] == pytest.approx(100.0)
    assert np.isnan(found[4])


def test_names_of_runs_and_warnings_are_escaped_in_whatever_alphabet():
    d = make_diagnosis()
    names = ("<img src=x onerror=alert(1)>", "$\\frac{1}{$", "\u8d8a\u91ce", "\udcff")
    hostile = "<b>&"
    text = page(replace(extended(d), trace=replace(d.trace, names=names, after=d.trace.measured + 0.01),
            warnings=(hostile,), gain_per_run=(
        (names[0], 20.0, 9.0), (names[1], 0.0, 1.0))))  # fmt: skip
    assert "<img" not in re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert "&lt;img src=x" in text
    assert "\u8d8a\u91ce" in text
    assert hostile not in text


def test_a_name_that_is_not_text_can_be_written(tmp_path):
    text = write_report(in_words(make_diagnosis(name="bad \udcff name")), tmp_path / "deep" / "r.html").read_text(
        encoding="utf-8"
    )
    assert "bad ? name" in text


def test_ids_of_the_page_are_unique_and_every_reference_has_its_target():
    text = page(extended(make_diagnosis()))
    ids = re.findall(r' id="([^"]*)"', text)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:url\(#|href="#)([^")]+)', text)) <= set(ids)


def test_the_page_stays_small_for_ninety_runs():
    d = make_diagnosis()
    trace = make_trace(90, 121)
    rows = tuple((f"run{i}", 20.0, 10.0) for i in range(90))
    text = page(replace(d, trace=replace(trace, after=trace.measured + 0.01), gain_per_run=rows))
    assert len(text.encode()) < 5e6


def test_a_diagnosis_without_trace_has_a_page_in_words():
    text = page(in_words(make_diagnosis()))
    assert "Worst at 90 to 135 deg." in text
    assert "data-linked" not in re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)


def test_the_gain_says_when_it_may_be_none_or_a_loss():
    assert "no gain" not in gain_words(GAIN)
    assert "may be no gain" in gain_words(Gain("ED", 10.0, 9.5, 0.05, (-0.1, 0.2), "13/24"))
    worse = gain_words(Gain("ED", 10.0, 12.0, -0.2, (-0.3, -0.1), "3/24"))
    assert "20 % more" in worse
    assert "worse" in worse


def test_nothing_named_for_want_of_data_is_not_called_nothing_found():
    d = make_diagnosis("none")
    assert "Nothing found" not in headline(d)
    assert "Nothing found" in headline(replace(d, warnings=()))


def test_the_page_of_a_simulation_names_it_and_not_the_ship_file():
    own = Calibrated(21.6, 14.2, (11.0, 17.0), 120.0, True)
    made = replace(
        make_diagnosis(), simulation="sim.py:simulate", calibration=own, extended_model="corrected.py:corrected"
    )
    text = diagnosis_page(made)
    assert "Errors of your simulation" in text
    assert "shipbench diagnose trial --model sim.py:simulate" in text
    assert "compares it with your simulation" in text
    assert "compares it with <code>physics</code>" not in text
