"""Errors of the record are told first, and corrected or refused before anything is fitted."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipbench.data.reread import reread
from shipbench.diagnosis import diagnose as diagnosis
from shipbench.diagnosis.preparation.base import Prepared
from shipbench.diagnosis.preparation.record_errors import correct_record_errors, refuse_contradictions
from shipbench.errors import InputError
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import DELTA, PSI, STATES, N, R, U, V, X, Y
from shipbench.simulate.trials import Trials, sea_trials

FOOT, KNOT, DEGREE, NAUTICAL = 0.3048, 1852.0 / 3600.0, np.pi / 180.0, 1852.0


@cache
def trials(runs: int = 12) -> Dataset:
    return sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=runs))


def read_as(factors: dict[int, float], data: Dataset | None = None) -> Dataset:
    """Channels (with the commands of actuators) recorded as so many times ours."""
    data = data or trials()
    runs = []
    for run in data.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        for channel, factor in factors.items():
            states[:, channel] *= factor
            if channel >= N:
                inputs[:, channel - N] *= factor
        runs.append(replace(run, states=states, inputs=inputs))
    return data.with_runs(runs)


def in_time(factor: float) -> Dataset:
    data = trials()
    return replace(data, dt=data.dt * factor, runs=tuple(replace(run, t=run.t * factor) for run in data.runs))


CORRECTED = {
    "positions in feet": {X: 1.0 / FOOT, Y: 1.0 / FOOT},
    "heading in degrees": {PSI: 1.0 / DEGREE},
    "surge in knots": {U: 1.0 / KNOT},
    "speeds in knots": {U: 1.0 / KNOT, V: 1.0 / KNOT},
    "revolutions in rev/s": {N: 1.0 / 60.0},
    "x to the south": {X: -1.0},
    "yaw rate to port": {R: -1.0},
    "rudder to port": {DELTA: -1.0},
}


@pytest.mark.parametrize("what", CORRECTED)
def test_what_the_check_has_a_line_for_is_corrected_and_said(what: str):
    record = correct_record_errors(Prepared(read_as(CORRECTED[what])))
    for run, true in zip(record.dataset.runs, trials().runs, strict=True):
        np.testing.assert_allclose(run.states, true.states, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(run.inputs, true.inputs, rtol=1e-6, atol=1e-9)
    factors = {e.channel: e.factor for e in record.errors}
    assert {STATES[c] for c in CORRECTED[what]} == {c for c in factors if not c.endswith("_c")}
    assert all("corrected before the fit" in line for line in record.notes)
    assert len(record.notes) >= 1
    refuse_contradictions(record)


def test_east_and_north_exchanged_are_read_as_such():
    runs = [replace(run, states=run.states[:, [Y, X, *range(2, 10)]]) for run in trials().runs]
    record = correct_record_errors(Prepared(trials().with_runs(runs)))
    np.testing.assert_array_equal(record.dataset.runs[3].states, trials().runs[3].states)
    assert [(e.channel, e.factor) for e in record.errors] == [("x", 1.0)]


def test_a_clean_record_stays_as_it_is():
    record = correct_record_errors(Prepared(trials()))
    assert record.dataset is trials()
    assert (record.errors, record.notes) == ((), ())
    refuse_contradictions(Prepared(trials()))


def test_a_log_that_reads_too_little_is_left_to_the_fit():
    record = correct_record_errors(Prepared(read_as({U: 0.8, V: 0.8})))
    assert (record.errors, record.notes) == ((), ())


CONTRADICTIONS = {
    "positions in km": (
        read_as,
        {X: 1e-3, Y: 1e-3},
        r"positions move by 0\.\d+ m where heading and speeds say \d{3} m",
    ),
    "positions in degrees": (read_as, {X: 1.0 / 60.0 / NAUTICAL, Y: 1.6 / 60.0 / NAUTICAL}, "positions move by"),
    "time in minutes": (in_time, 1.0 / 60.0, r"positions move by \d{3,} m where heading and speeds say \d\.\d+ m"),
    "yaw rate not recorded": (read_as, {R: 0.0}, "the heading turns by .* deg where the yaw rate says 0 deg"),
}


@pytest.mark.parametrize("what", CONTRADICTIONS)
def test_a_record_that_contradicts_itself_is_refused_before_any_fit(monkeypatch, what: str):
    make, wrong, message = CONTRADICTIONS[what]
    monkeypatch.setattr(diagnosis, "plain_model", lambda *_: pytest.fail("fitted"))
    with pytest.raises(InputError, match=f"{message}.*(?s:.)*(Correct|data check)"):
        diagnosis.diagnose(make(wrong), gain=False)


def test_samples_rarer_than_a_turn_are_refused():
    with pytest.raises(InputError, match=r"a sample every 1000 s.*in seconds"):
        diagnosis.diagnose(in_time(1000.0), gain=False)


def test_noise_of_a_ship_at_rest_and_a_gyro_s_constant_error_are_no_contradiction():
    rng = np.random.default_rng(0)
    still = [
        replace(run, states=run.states * 0.0 + 0.5 * rng.standard_normal(run.states.shape) * (np.arange(10) < 2))
        for run in trials().runs
    ]
    prepared = Prepared(trials().with_runs(still))
    assert refuse_contradictions(prepared) is prepared
    drifting = [replace(run, states=run.states + 0.002 * (np.arange(10) == R)) for run in trials().runs]
    prepared = Prepared(trials().with_runs(drifting))
    assert refuse_contradictions(prepared) is prepared


def test_a_data_set_is_read_again_as_its_folder_would_be():
    data = trials()
    cut = reread(data, {"scale": {"u": 2.0}, "runs": {data.runs[0].id: {"cut": [[30.0, 40.0]], "load": "ballast"}}})
    assert [run.id for run in cut.runs[:3]] == [f"{data.runs[0].id}#1", f"{data.runs[0].id}#2", data.runs[1].id]
    assert cut.runs[0].group == cut.runs[1].group == data.runs[0].group
    assert cut.runs[0].meta.other["load"] == "ballast"
    np.testing.assert_allclose(cut.runs[2].states[:, U], 0.5 * data.runs[1].states[:, U])
