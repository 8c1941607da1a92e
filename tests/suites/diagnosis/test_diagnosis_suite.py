"""The suite with stubs in place of the diagnosis: one that is told the answer, one that is always wrong, one that
fails."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from typer.main import get_command

from shipbench.cli.app import app
from shipbench.diagnosis.result import Cause, Diagnosis, Estimate, Gain
from shipbench.errors import InputError
from shipbench.simulate.trials import Trials
from shipbench.suites.diagnosis import scores as scores
from shipbench.suites.diagnosis import ships as case_ships
from shipbench.suites.diagnosis.cases import KINDS, count, draw_case
from shipbench.suites.diagnosis.page import read_rows, render, tables, write_page
from shipbench.suites.diagnosis.suite import Job, run_case, run_suite, suite_command

TINY = Trials(runs=4, samples=40)
PAGE = Path(__file__).parents[3] / "leaderboards" / "diagnosis.md"
QUICK = {"plan": TINY, "oracle": False, "baselines": False, "workers": 1}
CALLS: list[str] = []


def diagnosis(named=(), verdict=None, unknown=None, gain=0.5, confused=(), parameters=None) -> Diagnosis:
    causes = tuple(
        Cause(n, i + 1, 30.0, 0.001, parameters or {}, confused_with=tuple(confused)) for i, n in enumerate(named)
    )
    improved = Gain("ED", 10.0, 10.0 * (1 - gain), gain, (gain, gain), "4/4")
    return Diagnosis(
        "trials",
        verdict or ("found" if named else "none"),
        causes,
        (),
        (),
        {},
        "physics",
        "0",
        1.5,
        gain=improved,
        unknown=unknown,
    )


def always_current(dataset, *, gain=True, seed=0, only=()):
    CALLS.append(dataset.fingerprint)
    return diagnosis(only or ("current",), gain=0.8 if only else 0.4)


def nothing(dataset, *, gain=True, seed=0):
    return diagnosis()


def time_it_is(dataset, *, gain=True, seed=0):
    return diagnosis(verdict="unknown", unknown={"channel": "yaw", "variable": "time"})


def failing(dataset, *, gain=True, seed=0):
    raise ValueError("no motion in the data")


def row(kind="single", truth=("current",), named=("current",), size=(1.0,), **more):
    base = {
        "key": "k", "kind": kind, "truth": list(truth), "named": list(named), "size": list(size),
        "values": [{"speed": 0.3, "to": 1.0}],
        "status": "ok", "reason": "", "verdict": "found" if named else "none", "confused": {}, "estimates": {},
        "evidence": {}, "unknown": None, "variables": [],
        "detail": {}, "seconds": 20.0, "gain": 0.4, "ship": "kcs-80m",
    }  # fmt: skip
    return base | more


def value(rows, figure):
    return next(line["value"] for line in scores.figures(rows) if line["figure"] == figure)


@pytest.fixture
def any_ship(monkeypatch):
    """A stub does not mind how the ship steers, and whether she does takes as long to tell as her runs."""
    monkeypatch.setattr(case_ships, "steers", lambda ship: True)


@pytest.mark.long
@pytest.mark.usefixtures("any_ship")
def test_false_alarms_of_a_stub_that_always_names_are_all_counted(tmp_path):
    rows = run_suite(tmp_path, diagnose=always_current, seeds_per_effect=1, kinds=("none-other",), **QUICK)
    assert len(rows) == count("none-other", 1)
    assert value(rows, "false alarms, other structure") == 1.0
    quiet = [row(kind="none-same", truth=(), named=()), row(kind="none-same", truth=(), named=(), verdict="unknown")]
    assert value(quiet, "false alarms, same structure") == 0.5, "a claim of an unknown cause is an alarm"


@pytest.mark.usefixtures("any_ship")
def test_unknown_is_right_only_with_the_right_variable(tmp_path):
    rows = run_suite(tmp_path, diagnose=time_it_is, seeds_per_effect=1, kinds=("outside",), **QUICK)
    timed = [r for r in rows if r["variables"] == ["time"]]
    assert len(timed) == 2
    assert value(rows, "outside: unknown and right variable") == pytest.approx(2 / len(rows))
    assert value(rows, "outside: says unknown") == 1.0


@pytest.mark.usefixtures("any_ship")
def test_a_failing_case_is_a_row_with_its_error_and_counts_as_wrong(tmp_path):
    rows = run_suite(tmp_path, diagnose=failing, seeds_per_effect=1, kinds=("unit",), **QUICK)
    assert {r["status"] for r in rows} == {"failed"}
    assert "ValueError: no motion in the data" in rows[0]["reason"]
    assert "test_diagnosis_suite.py" in rows[0]["reason"]
    assert value(rows, "unit_or_sign_error named") == 0.0
    assert "no motion in the data" in tables(rows)[-1].markdown()


@pytest.mark.long
@pytest.mark.usefixtures("any_ship")
def test_resuming_keeps_finished_rows_and_repeats_failed_and_changed_ones(tmp_path):
    CALLS.clear()
    first = run_suite(tmp_path, diagnose=always_current, seeds_per_effect=1, kinds=("unit",), **QUICK)
    assert len(CALLS) == len(first) == count("unit", 1)
    files = sorted((tmp_path / "rows").glob("*.json"))
    files[0].unlink()
    files[1].write_text(json.dumps(json.loads(files[1].read_text()) | {"status": "failed"}))
    again = run_suite(tmp_path, diagnose=always_current, seeds_per_effect=1, kinds=("unit",), **QUICK)
    assert len(CALLS) == len(first) + 2
    assert again == first
    run_suite(
        tmp_path,
        diagnose=always_current,
        seeds_per_effect=1,
        kinds=("unit",),
        **(QUICK | {"plan": Trials(runs=3, samples=40)}),
    )
    assert len(CALLS) == 2 * len(first) + 2, "another plan: nothing may be kept"
    run_suite(
        tmp_path,
        diagnose=always_current,
        seeds_per_effect=1,
        kinds=("unit",),
        resume=False,
        **(QUICK | {"plan": Trials(runs=3, samples=40)}),
    )
    assert len(CALLS) == 3 * len(first) + 2


@pytest.mark.long
def test_worker_processes_give_the_rows_of_one_process(tmp_path):
    one = run_suite(tmp_path / "one", diagnose=nothing, seeds_per_effect=1, kinds=("unit",), **QUICK)
    two = run_suite(tmp_path / "two", diagnose=nothing, seeds_per_effect=1, kinds=("unit",), **(QUICK | {"workers": 2}))
    assert two == one


def test_a_row_says_what_was_hidden_what_was_found_and_what_the_oracle_gains():
    found = run_case(Job("single", 5, 3, "test", always_current, plan=TINY))
    case = draw_case("single", 5, 3, plan=TINY)
    assert found["truth"] == list(case.truth) == ["current"]
    assert (found["gain"], found["oracle_gain"]) == (0.4, 0.8)
    assert set(found["baselines"]) == {"white residuals", "derivative regression"}
    assert found["values"] == case.values()
    blind = run_case(Job("single", 5, 3, "test", nothing, plan=TINY, baselines=False))
    assert blind["oracle_gain"] is None, "a diagnosis that cannot be told the names has no oracle"


def test_an_unknown_kind_and_no_draws_are_told(tmp_path):
    with pytest.raises(InputError, match="unknown kind of case 'singles'"):
        run_suite(tmp_path, diagnose=nothing, kinds=("singles",))
    with pytest.raises(InputError, match="draws per effect: 0"):
        run_suite(tmp_path, diagnose=nothing, seeds_per_effect=0)


def test_the_help_names_every_kind():
    (option,) = (o for o in get_command(app).commands["suite"].commands["diagnosis"].params if o.name == "kinds")
    assert option.help.split(" ")[0].split(",") == list(KINDS)


def test_wilsons_interval_is_the_published_one():
    # 81 of 263: Newcombe (1998), Table I, method 3
    assert scores.wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert scores.wilson(0, 20)[0] == pytest.approx(0.0, abs=1e-9)
    assert all(math.isnan(x) for x in scores.wilson(0, 0))


def test_the_hull_is_skipped_or_counted_as_the_line_says():
    rows = [row(named=("hull_derivatives", "current"))]
    assert value(rows, "first-named cause right, 1x") == 1.0
    assert value(rows, "first of all causes right, 1x") == 0.0
    own = [row(truth=("hull_derivatives",), named=("hull_derivatives",))]
    assert value(own, "first-named cause right, 1x") == 1.0
    null = [row(kind="none-other", truth=(), named=("hull_derivatives",))]
    assert value(null, "false alarms, other structure") == 0.0
    assert value(null, "false alarms with the hull, other structure") == 1.0


def test_a_class_is_right_when_declared_or_said_to_be_indistinguishable():
    assert scores.right_class(row(named=("current_per_run",)))
    assert scores.right_class(row(named=("wind",), confused={"wind": ["current"]}))
    assert not scores.right_class(row(named=("wind",), confused={"heading_bias": ["current"]}))
    assert not scores.right_class(row(named=()))
    assert not scores.right_class(row(kind="none-other", truth=(), named=("wind",)))


def test_a_pair_is_exact_without_a_third_cause():
    pair = {"kind": "pair", "truth": ("current", "rudder_offset"), "size": (0.6, 0.9)}
    assert scores.exact_pair(row(named=("rudder_offset", "current"), **pair))
    assert scores.exact_pair(row(named=("rudder_offset", "hull_derivatives", "current"), **pair))
    assert not scores.exact_pair(row(named=("rudder_offset", "current", "wind"), **pair))
    assert not scores.exact_pair(row(named=("current",), **pair))


def test_sizes_are_compared_without_directions_and_intervals_are_counted():
    errors, covered = scores.size_errors(
        [row(estimates={"current": {"speed": [0.33, 0.31, 0.35], "to": [3.0, 2.9, 3.1]}})]
    )
    assert errors == pytest.approx([0.1])
    assert covered == [False]
    assert scores.size_errors([row(estimates={"wind": {"speed": [0.3, 0.2, 0.4]}})]) == ([], [])


def test_a_change_needs_its_effect_and_its_run():
    change = {
        "kind": "change",
        "truth": ("change_point",),
        "named": ("change_point",),
        "detail": {"changed": "thrust_gain", "from_run": 9},
    }
    there = {"change_point": {"from_run": [9.0, 8.0, 10.0]}}
    assert scores.right_change(row(**change, estimates=there, evidence={"change_point": "thrust_gain from run 9"}))
    assert not scores.right_change(row(**change, estimates=there, evidence={"change_point": "current from run 9"}))
    assert not scores.right_change(
        row(
            **change,
            estimates={"change_point": {"from_run": [12.0, 11.0, 13.0]}},
            evidence={"change_point": "thrust_gain"},
        )
    )


def test_the_share_of_the_oracles_gain_leaves_out_what_gains_nothing():
    rows = [row(gain=0.3, oracle_gain=0.4), row(gain=0.0, oracle_gain=0.2), row(gain=0.5, oracle_gain=0.01)]
    assert value(rows, "share of the oracle's gain") == pytest.approx(0.5)


def test_estimates_travel_from_the_diagnosis_to_the_row():
    def told(dataset, *, gain=True, seed=0):
        return diagnosis(("current",), parameters={"speed": Estimate(0.25, "m/s", (0.2, float("nan")))})

    found = run_case(Job("single", 5, 3, "test", told, plan=TINY, baselines=False, oracle=False))
    assert found["estimates"]["current"]["speed"][:2] == [0.25, 0.2]


def test_the_page_is_rendered_from_the_rows_beside_it(tmp_path):
    page, rows = suite_command(
        diagnose=nothing,
        per_effect=1,
        kinds="unit",
        out=tmp_path / "run",
        page=tmp_path / "page",
        workers=1,
        plan=TINY,
        baselines=False,
    )
    kept, about = read_rows(tmp_path / "page" / "diagnosis.json")
    assert page.read_text() == render(kept, about)
    assert len(kept) == len(rows)
    assert "Command: `shipbench suite diagnosis` (seed 0, 1 draws of each effect and size)" in page.read_text()
    assert "| rudder to port |" in page.read_text()


def test_a_page_of_all_kinds_says_what_falls_short(tmp_path):
    about = {
        "runs": 24, "samples": 120, "command": "c", "seed": 0, "per_effect": 1, "which": "test", "workers": 2,
        "code": {"shipbench": "0", "source": "s", "git": ""}, "machine": {"cpus": 2, "platform": "p", "python": "3"},
    }  # fmt: skip
    baselines = {
        "white residuals": {"named": ["wind"], "best": []},
        "derivative regression": {"named": ["current"], "best": []},
    }
    rows = [
        row(baselines=baselines),
        row(named=("wind",), baselines=baselines),
        row(size=(0.3,)),
        row(kind="none-same", truth=(), named=()),
    ]
    text = write_page(tmp_path, rows, about).read_text()
    assert "| first-named cause right, 1x | 0.50 |" in text
    assert "- first-named cause right, 1x: 0.50, must reach >= 0.9 (n = 2)." in text
    assert "false alarms, same structure: reached, but its 95 % interval" in text
    assert "| derivative regression | 1.00 |" in text
    assert "| single | current | wind | 1 |" in text


@pytest.mark.skipif(not PAGE.is_file(), reason="the whole suite has not been run in this checkout")
def test_the_published_page_matches_its_rows():
    rows, about = read_rows(PAGE.with_name("diagnosis.json"))
    assert PAGE.read_text() == render(rows, about)
