"""Speeds that were derived from positions and headings are no measurements of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.preparation.derived_speeds import marked
from shipbench.effects.base import EFFECTS
from shipbench.importing.speeds import derivative
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.signals import PSI, R, U, V, X, Y
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials


def with_derived_speeds(data: Dataset) -> Dataset:
    """As `data import` makes them of a log without speeds."""

    scale = (data.ship.L / 9.81) ** 0.5

    def run(given: Run) -> Run:
        track, turn = (derivative(given.t, given.states[:, at], given.t, data.dt, scale).rate for at in ([X, Y], [PSI]))
        states, c, s = given.states.copy(), np.cos(given.states[:, PSI]), np.sin(given.states[:, PSI])
        states[:, U], states[:, V], states[:, R] = (
            c * track[:, 0] + s * track[:, 1],
            c * track[:, 1] - s * track[:, 0],
            turn[:, 0],
        )
        return replace(given, states=states)

    return data.with_runs([run(r) for r in data.runs])


@pytest.mark.long
@pytest.mark.parametrize("ship", ["kcs", "container130", "tanker"])
def test_sensors_are_told_from_derivatives(ship):
    def sail(**plan: float) -> Dataset:
        trials = Trials(runs=6, **plan)
        return (
            published_trials(PUBLISHED[ship], 1, (), trials)
            if ship in PUBLISHED
            else sea_trials(load_mmg_ship(ship), 1, (), trials)
        )

    for noise, waves in ((1.0, 0.0), (0.3, 1.0), (0.0, 0.0), (0.0, 1.0)):
        assert marked(sail(noise=noise, waves=waves)).derived == (), (noise, waves)
    measured = sail()
    derived = with_derived_speeds(measured)
    assert marked(derived).derived == ("u", "v", "r")
    gyro = [
        replace(d, states=np.where(np.arange(10) == R, m.states, d.states))
        for d, m in zip(derived.runs, measured.runs, strict=True)
    ]
    assert marked(derived.with_runs(gyro)).derived == ("u", "v")


def test_a_perfect_log_of_the_speed_beside_a_poor_position_is_a_sensor():
    data, rng = (
        sea_trials(load_mmg_ship("kcs"), 1, (), Trials(runs=12, samples=60, noise=0.0)),
        np.random.default_rng(0),
    )
    noisy = data.with_runs(
        [replace(r, states=r.states + np.pad(rng.standard_normal((len(r), 2)), ((0, 0), (0, 8)))) for r in data.runs]
    )
    assert marked(noisy).derived == ()


@pytest.mark.long
@pytest.mark.parametrize("name", ["", pytest.param("current", marks=pytest.mark.long)])
def test_derived_speeds_are_no_evidence(name):
    """Counted as measured, they made Mariner's force unknown with a score of 160."""
    hidden = [Hidden(EFFECTS.get(name), (0.3, 0.2))] if name else []
    data = with_derived_speeds(published_trials(PUBLISHED["mariner"], 9003, hidden, Trials(runs=16, noise=0.4)))
    found = diagnose(data, gain=False)
    assert [c.effect for c in found.causes] == ([name] if name else [])
    assert found.verdict == ("found" if name else "none")
    assert found.warnings[0].startswith("not counted as measured: u, v and r")
    assert np.isnan(found.trace.white[..., U]).all()
    assert np.isfinite(found.trace.white[..., X]).any()
