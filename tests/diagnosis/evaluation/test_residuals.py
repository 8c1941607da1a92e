"""What is wrong is found where it was planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_diagnosis import make_trace

from shipbench.diagnosis.evaluation import residuals as wrong
from shipbench.diagnosis.evaluation.dependence import Follows
from shipbench.diagnosis.evaluation.residuals import _whiteness, error_tables, what_is_wrong


def test_a_force_that_follows_the_heading_is_said_to():
    trace = make_trace()
    trace.force[..., 1] += 3e-3 * np.cos(trace.measured[:, ::5, 2])
    line = next(w for w in what_is_wrong(trace) if w.channel == "sway")
    assert line.depends_on == "heading"
    assert "mm/s^2 at" in line.when
    assert "deg" in line.when


def test_a_force_that_follows_the_rudder_is_said_to():
    trace = make_trace()
    trace.force[..., 1] += 0.02 * trace.inputs[:, ::5, 1]
    assert next(w for w in what_is_wrong(trace) if w.channel == "sway").depends_on == "rudder"


def test_a_force_without_cause_follows_nothing():
    follows = [next(w for w in what_is_wrong(make_trace(seed=s)) if w.channel == "sway").depends_on for s in range(6)]
    assert sum(bool(f) for f in follows) <= 1


def test_a_dependence_that_is_sure_but_tiny_is_not_spoken_of(monkeypatch):
    """Long records make a share of the variance that rounds to nothing significant."""
    trace = make_trace()
    found = error_tables(trace)
    for share, said in ((0.004, False), (0.3, True)):
        tables = replace(found, follows={axis: [Follows("rudder", share, 0.001)] for axis in found.follows})
        monkeypatch.setattr(wrong, "error_tables", lambda _, tables=tables: tables)
        lines = what_is_wrong(trace)
        assert lines
        assert all(("follows rudder" in line.when) is said for line in lines)


def test_the_shares_are_those_of_the_planted_channel():
    lines = what_is_wrong(make_trace())
    assert lines[0].channel == "sway"
    assert lines[0].share_of_error == pytest.approx(1.0, abs=1e-6)
    assert "times larger after" in lines[0].when


def test_shares_do_not_depend_on_the_unit_of_a_channel():
    trace = make_trace()
    trace.before[..., 5] += 0.002
    shares = error_tables(trace).share
    for array in (trace.measured, trace.before):
        array[..., 5] *= 40.0
    assert error_tables(trace).share["yaw rate"] == pytest.approx(shares["yaw rate"], rel=1e-6)
    assert 0.0 < shares["yaw rate"] < 1.0


def test_a_channels_error_is_sliced_by_itself_and_the_worst_run_is_named():
    trace = make_trace()
    fast = trace.measured[..., 3] > 4.0
    trace.before[..., 2] += np.where(fast, 0.1, 0.01)
    trace.before[5, :, 2] += 1.0
    tables = error_tables(trace)
    rows = tables.by_channel[("heading", "speed")]
    assert max(rows, key=lambda r: r.rms).high > 4.0
    assert tables.by_channel[("surge", "speed")][0].rms == 0.0
    assert tables.worst_runs[0][0] == "r5"
    assert tables.size["heading"] > 1.0  # deg


def test_white_residuals_are_white_and_coloured_ones_are_not():
    told = [v for seed in range(10) for v in _whiteness(make_trace(seed=seed)).values()]
    assert np.mean(np.array(told) > 1.0) <= 0.15  # of 60, at the 5 % level
    trace = make_trace()
    coloured = np.cumsum(trace.white, axis=1) / 5.0
    assert min(error_tables(replace(trace, white=coloured)).white.values()) > 10.0


def test_a_residual_that_repeats_the_rudder_is_seen_against_it():
    trace = make_trace()
    told = error_tables(replace(trace, white=trace.white + 5.0 * trace.inputs[..., 1:2])).inputs
    assert told[("sway", "rudder")] > 3.0 > error_tables(trace).inputs[("sway", "rudder")]


def test_padding_and_a_single_run_are_taken():
    trace = make_trace(runs=3)
    trace.measured[0, 30:] = trace.before[0, 30:] = np.nan
    assert what_is_wrong(trace)
    assert what_is_wrong(make_trace(runs=1))


def test_a_run_without_data_a_diverged_one_and_very_few_samples_are_taken():
    trace = make_trace(runs=6)
    for array in (trace.measured, trace.before, trace.inputs, trace.white, trace.force):
        array[2] = np.nan
    trace.before[4, 20:] = np.inf
    trace.before[5, 20:] = 1e200
    assert what_is_wrong(trace)
    for samples in (2, 4, 21):
        assert all(np.isfinite(w.share_of_error) for w in what_is_wrong(make_trace(runs=1, samples=samples)))


def test_a_model_without_error_has_no_lines():
    trace = make_trace()
    assert what_is_wrong(replace(trace, before=trace.measured.copy())) == ()
