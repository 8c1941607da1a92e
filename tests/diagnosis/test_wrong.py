"""What is wrong is found where it was planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.outcome import Trace
from shipbench.diagnosis.wrong import error_tables, what_is_wrong


def make_trace(runs: int = 12, samples: int = 61, seed: int = 0) -> Trace:
    """Runs on courses all round, with white residuals, no missing force, and a sway error that grows with time."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(samples))
    measured = np.zeros((runs, samples, 6))
    measured[..., 2] = np.linspace(0.0, 2.0 * np.pi, runs, endpoint=False)[:, None] + 0.3 * np.sin(t / 20.0)
    measured[..., 3] = rng.uniform(2.0, 6.0, (runs, 1)) + 0.2 * np.sin(t / 9.0)
    measured[..., 4], measured[..., 5] = 0.3 * np.sin(t / 7.0 + rng.uniform(0, 6, (runs, 1))), 0.01 * np.cos(t / 11.0)
    measured[..., 0] = np.cumsum(measured[..., 3], axis=1)
    before = measured.copy()
    before[..., 4] += 0.01 * t * rng.choice([-1.0, 1.0], (runs, 1))
    inputs = np.zeros((runs, samples, 4))
    inputs[..., 0], inputs[..., 1] = 50.0, 0.2 * np.sin(t / 7.0 + rng.uniform(0, 6, (runs, 1)))
    knots = t[::5]
    force = 1e-4 * rng.standard_normal((runs, len(knots), 3))
    white = rng.standard_normal((runs, samples, 6))
    names = tuple(f"r{i}" for i in range(runs))
    return Trace(np.arange(runs), names, np.zeros(runs), t, measured, before, before, inputs, knots, force, 0.1 + 0 * force, force, white)


def test_a_force_that_follows_the_heading_is_said_to():
    trace = make_trace()
    trace.force[..., 1] += 3e-3 * np.cos(trace.measured[:, ::5, 2])
    line = next(w for w in what_is_wrong(trace) if w.channel == "sway")
    assert line.depends_on == "heading"
    assert "heading" in line.when


def test_a_force_that_follows_the_rudder_is_said_to():
    trace = make_trace()
    trace.force[..., 1] += 0.02 * trace.inputs[:, ::5, 1]
    assert next(w for w in what_is_wrong(trace) if w.channel == "sway").depends_on == "rudder"


def test_a_force_without_cause_follows_nothing():
    follows = [next(w for w in what_is_wrong(make_trace(seed=s)) if w.channel == "sway").depends_on for s in range(6)]
    assert sum(bool(f) for f in follows) <= 1


def test_the_shares_are_those_of_the_planted_channel():
    lines = what_is_wrong(make_trace())
    assert lines[0].channel == "sway"
    assert lines[0].share_of_error == pytest.approx(1.0, abs=1e-6)
    assert "grows" in lines[0].when


def test_white_residuals_are_white_and_coloured_ones_are_not():
    trace = make_trace()
    coloured = np.cumsum(trace.white, axis=1) / 5.0
    assert max(error_tables(trace).white.values()) < 2.0
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
