"""Dependences of the missing force on what was recorded."""

from __future__ import annotations

import numpy as np
from made_diagnosis import make_trace

from shipbench.diagnosis.evaluation.dependence import Follows, curve, follows, with_speed
from shipbench.diagnosis.evaluation.residuals import force_words, what_is_wrong


def test_nothing_is_said_of_headings_that_nobody_sailed():
    """On a passage of two courses the harmonics went to 49 m/s^2 between them."""
    trace = make_trace()
    trace.measured[..., 2] = np.deg2rad(np.where(np.arange(12) < 6, 190.0, 250.0))[:, None] + 0.05 * np.sin(
        trace.t / 20.0
    )
    trace.force[..., 0] += 3e-3 * np.cos(trace.measured[:, ::5, 2])
    found = curve(trace, 0, "heading")
    assert found is not None
    sailed = np.isfinite(found.y)
    assert found.x[sailed].min() > 170.0
    assert found.x[sailed].max() < 270.0
    assert np.nanmax(np.abs(found.y)) < 6e-3
    assert "missing surge force" in force_words(trace, 0, Follows("heading", 0.9, 0.01))


def test_a_force_that_follows_the_speed_is_said_to():
    trace = make_trace()
    trace.force[..., 0] += 2e-4 * trace.measured[:, ::5, 3] ** 2
    best = follows(trace)["surge"][0]
    assert best.variable == "speed"
    assert best.share > 0.9
    assert best.p <= 0.02


def test_a_force_that_follows_the_time_of_the_run_is_said_to():
    trace = make_trace()
    trace.force[..., 2] += 1e-5 * trace.knots
    assert follows(trace)["yaw"][0].variable == "time"
    assert follows(trace)["yaw"][0].p <= 0.02


def test_a_dependence_that_grows_with_speed_is_said_to_and_one_that_does_not_is_not():
    rng = np.random.default_rng(3)
    trace = make_trace(runs=24)
    steady = 3e-3 * np.cos(trace.measured[:, ::5, 2])
    speed = trace.measured[:, ::5, 3]
    trace.force[..., 1] += steady * (speed / 4.0) ** 2 + 1e-4 * rng.standard_normal(steady.shape)
    assert with_speed(trace, 1, "heading") > 1.5
    assert "faster half" in next(w for w in what_is_wrong(trace) if w.channel == "sway").when
    other = make_trace(runs=24)
    other.force[..., 1] += steady
    assert with_speed(other, 1, "heading") == 1.0


def test_a_force_that_is_each_runs_own_is_not_taken_for_a_dependence():
    found = 0
    for seed in range(12):
        trace = make_trace(seed=seed)
        trace.force[:] = 1e-3 * np.random.default_rng(100 + seed).standard_normal((12, 1, 3))
        found += sum(min(f.p for f in rows) <= 0.02 for rows in follows(trace, seed).values())
    assert found <= 4  # of 36 at the 2 % level; a test that takes the samples for independent finds nearly all
