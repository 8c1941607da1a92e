"""What receivers and compasses of real ships do to a record: errors that last, and velocities that were filtered in the
earth's axes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit, made_plant
from scipy.signal import butter, lfilter, sosfiltfilt

import shipbench.simulate.trials
from shipbench.checking.recording import Recording
from shipbench.checking.track import keeps_time
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.preparation import time_offsets as clocks
from shipbench.diagnosis.preparation.base import Prepared
from shipbench.diagnosis.preparation.time_offsets import late_velocities_of
from shipbench.diagnosis.preparation.water_speeds import speeds_over_ground
from shipbench.diagnosis.selection.analysis import THRESHOLD, plain_model
from shipbench.diagnosis.selection.stepwise import select
from shipbench.effects.base import EFFECTS, delayed
from shipbench.estimation.baseline import beside_noise_of, null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin, fit
from shipbench.estimation.laplace import Model
from shipbench.estimation.linearisation import Scales
from shipbench.estimation.noise import Colour
from shipbench.estimation.noise_selection import colour_of
from shipbench.estimation.outliers import left_out
from shipbench.estimation.term import Term
from shipbench.estimation.thresholds import THRESHOLDS
from shipbench.physics.actuators import gear_path
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.reports.diagnosis.summary import summary_lines
from shipbench.signals import PSI, R, U, V, X, Y
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import WAVE_PERIOD, Trials, sea_trials

LATE = 3.0


@pytest.fixture(scope="module")
def trials() -> Dataset:
    return sea_trials(load_mmg_ship("kcs"), 3, (), Trials(runs=12, samples=120))


def _changed(data: Dataset, change) -> Dataset:
    states = [run.states.copy() for run in data.runs]
    for S in states:
        change(S)
    return data.with_runs([replace(run, states=S) for run, S in zip(data.runs, states, strict=True)])


@pytest.mark.parametrize(
    ("effect", "delay"), [("position_delay", 0.0), ("position_delay", 1.0), ("velocity_delay", 1.0)]
)
def test_no_delay_is_looked_for_where_the_track_shows_none(effect: str, delay: float):
    """What a hull's form lacks passed for velocities that are early by a second."""
    cause = EFFECTS.get(effect)
    hidden = Hidden(cause, (delay, 0.0)[: len(cause.parameters)])
    assert keeps_time(Recording(sea_trials(load_mmg_ship("kcs"), 3, (hidden,), Trials(runs=24)))) is (delay == 0.0)


def _filter_in_earth_axes(data: Dataset, T: float) -> Dataset:
    """Surge and sway behind a first-order filter of the earth-fixed velocity, turned back by the heading of the
    moment."""
    keep = float(np.exp(-data.dt / T))

    def change(S: np.ndarray) -> None:
        turn = np.exp(1j * S[:, PSI])
        earth = (S[:, U] + 1j * S[:, V]) * turn
        smooth, _ = lfilter([1.0 - keep], [1.0, -keep], earth, zi=[keep * earth[0]])
        S[:, U], S[:, V] = (smooth * np.conj(turn)).real, (smooth * np.conj(turn)).imag

    return _changed(data, change)


@pytest.fixture(scope="module")
def filtered(trials) -> Dataset:
    return _filter_in_earth_axes(trials, LATE)


OMEGA = 2.0 * np.pi / 5.0
LASTING = (
    (6.0, np.inf, False, lambda lag: np.exp(-lag / 6.0)),
    (8.0, 5.0, False, lambda lag: np.exp(-lag / 8.0) * (np.cos(OMEGA * lag) - np.sin(OMEGA * lag) / (8.0 * OMEGA))),
    (2.0, np.inf, True, lambda lag: np.exp(-lag / 2.0) * (1.0 + lag / 2.0 + lag**2 / 12.0)),
)


@pytest.mark.parametrize(("time", "period", "smooth", "correlation"), LASTING)
def test_whitened_noise_is_white_and_its_determinant_right(time, period, smooth, correlation):
    colour = Colour.white(7).with_channel(2, 16.0, time, period, smooth)
    lag = np.abs(np.subtract.outer(np.arange(7), np.arange(7)))
    covariance = np.eye(7) + 16.0 * correlation(lag)
    assert colour.factor[2] @ covariance @ colour.factor[2].T == pytest.approx(np.eye(7), abs=1e-9)
    for length in (3, 7):
        assert colour.log_determinant(np.array([length]))[0] == pytest.approx(
            np.linalg.slogdet(covariance[:length, :length])[1]
        )
    values = np.random.default_rng(0).standard_normal((2, 7, 6))
    white = colour.whitened(values)
    assert white[:, :, [0, 1, 3, 4, 5]] == pytest.approx(values[:, :, [0, 1, 3, 4, 5]])
    assert colour.whitened(np.where(np.arange(7)[:, None] < 4, values, 9.0))[:, :4] == pytest.approx(
        white[:, :4]
    )  # what follows does not matter


def _colour(data: Dataset) -> Colour:
    plant = Plant.of(data)
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    return colour_of(fit(plant, scales, Model(), origin.point, origin.hyper, guess=origin.motion))


@pytest.mark.long
def test_a_compass_whose_errors_last_is_told_from_independent_ones(trials):
    rng = np.random.default_rng(1)

    def change(S: np.ndarray) -> None:
        error = lfilter([1.0], [1.0, -np.exp(-1.0 / 8.0)], rng.standard_normal(len(S) + 50))[50:]
        S[:, PSI] += np.deg2rad(0.7) * error * np.sqrt(1.0 - np.exp(-2.0 / 8.0))

    assert not np.any(_colour(trials).share)
    share = _colour(_changed(trials, change)).share
    assert share[PSI] > 0.0
    assert not np.any(np.delete(share, PSI))


def _low_passed(data: Dataset) -> Dataset:
    """Motion behind a Butterworth filter of second order at 0.1 Hz, forth and back, as logs are often handed on."""
    filtered = butter(2, 2.0 * data.dt * 0.1, output="sos")

    def change(S: np.ndarray) -> None:
        S[:, PSI] = np.unwrap(S[:, PSI])
        S[:, :6] = sosfiltfilt(filtered, S[:, :6], axis=0)

    return _changed(data, change)


@pytest.mark.long
def test_what_a_cause_does_to_a_sensor_is_no_noise_once_it_is_named():
    """Beside the noise that a late position had been taken for, half of the delay was found in other sensors on a
    model."""
    late = Hidden(EFFECTS.get("position_delay"), (3.0,))
    null = plain_model(Plant.of(sea_trials(load_mmg_ship("kcs"), 4, (late,), Trials(runs=12, samples=80, noise=0.3))))
    assert null.scales.colour.share[:2].any()
    found = select(null, THRESHOLD)
    assert [t.label for t in found.final.model.terms] == ["position_delay"]
    assert not found.null.scales.colour.share.any()
    assert found.final.scales.colour is found.null.scales.colour
    assert beside_noise_of(found.final, found.null) is None


@pytest.mark.long
def test_a_record_that_was_filtered_shows_its_cause_and_nothing_else():
    """Its smooth errors had been an `unknown` force."""
    hidden = Hidden(EFFECTS.get("rudder_offset"), (0.03,))
    found = diagnose(_low_passed(published_trials(PUBLISHED["mariner"], 5015, (hidden,))), gain=False)
    assert ([c.effect for c in found.causes], found.unknown) == (["rudder_offset"], None)
    assert found.causes[0].parameters["offset"].value == pytest.approx(0.03, rel=0.35), (
        "the filter takes of the motion, too"
    )
    assert "smooth" in found.unexplained_after["taken_as_noise"]["heading"]


def test_noise_that_swings_has_nothing_at_frequency_zero():
    lag = np.arange(200.0)
    swings = np.linalg.inv(Colour.white(200).with_channel(0, 1.0, 9.0, 6.0).factor[0])[:, 0]
    correlation = swings * swings[0] - (lag == 0)
    # of a sampled signal what folds back from higher frequencies remains; at its period 20 times as much
    assert abs(correlation[0] + 2.0 * np.sum(correlation[1:])) < 0.5
    assert correlation[0] + 2.0 * np.sum(correlation[1:] * np.cos(2.0 * np.pi / 6.0 * lag[1:])) > 8.0


@pytest.mark.long
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_log_through_water_is_seen_and_put_over_ground(number):
    """It had been a current, and three faults of sensors besides."""
    drift = np.array([0.4, -0.3])

    def through_water(S: np.ndarray) -> None:
        c, s = np.cos(S[:, PSI]), np.sin(S[:, PSI])
        S[:, U], S[:, V] = S[:, U] - c * drift[0] - s * drift[1], S[:, V] - c * drift[1] + s * drift[0]

    data = sea_trials(
        load_mmg_ship("container130"), 20 + number, [Hidden(EFFECTS.get("current"), tuple(drift))], Trials(runs=12)
    )
    assert speeds_over_ground(Prepared(data)) == Prepared(data)
    logged = _changed(data, through_water)
    ready = speeds_over_ground(Prepared(logged))
    mended, (line,) = ready.dataset, ready.notes
    assert "through water" in line
    for run, true in zip(mended.runs, data.runs, strict=True):
        assert np.abs(run.states[:, [U, V]] - true.states[:, [U, V]]).max() < 0.05
    if number == 0:
        found = diagnose(logged, gain=False)
        assert [c.effect for c in found.causes] == ["current"]
        assert line in found.warnings


@pytest.mark.long
@pytest.mark.parametrize("ship", ["kcs", pytest.param("container130", marks=pytest.mark.long)])
def test_motion_with_the_waves_is_told_from_the_ships_own(ship):
    data = sea_trials(load_mmg_ship(ship), 11, (), Trials(runs=12, samples=120, waves=1.0))
    found = _colour(data)
    assert found.period[[U, V, R]] == pytest.approx(WAVE_PERIOD * (data.ship.L / 130.0) ** 0.5 / data.dt, rel=0.25)
    assert np.all(found.share[[U, V, R]] > 10.0)


@pytest.mark.long
def test_a_cause_is_seen_through_the_motion_with_the_waves():
    """Its score is 17 where that motion passes for errors that last."""
    hidden = [Hidden(EFFECTS.get("rudder_offset"), (0.05,))]
    found = diagnose(
        sea_trials(load_mmg_ship("container130"), 11, hidden, Trials(runs=12, samples=120, waves=1.0)), gain=False
    )
    (cause,) = found.causes
    assert cause.effect == "rudder_offset"
    assert cause.score > 30.0
    told = found.unexplained_after["taken_as_noise"]
    period = re.search(r"swings with a period of about ([\d.]+) s", told["yaw rate"])
    assert float(period[1]) == pytest.approx(WAVE_PERIOD, rel=0.25)
    assert f"yaw rate: {told['yaw rate']}" in " ".join(" ".join(summary_lines(found)).split())  # the lines are wrapped


@pytest.mark.long
@pytest.mark.parametrize(
    ("ship", "period"), [pytest.param("container130", 16.0, marks=pytest.mark.long), ("kcs", 20.0)]
)
def test_a_swell_is_told_from_the_ships_own_motion_though_the_latent_force_follows_it(ship, period, monkeypatch):
    """The force in yaw was 24 and 12 times the ordinary one, and hid whatever turns a ship."""
    monkeypatch.setattr(shipbench.simulate.trials, "WAVE_PERIOD", period)
    data = sea_trials(load_mmg_ship(ship), 11, (), Trials(runs=12, waves=0.5))
    plant = Plant.of(data)
    found = null_fit(plant, Scales(plant))
    assert np.exp(0.5 * found.hyper.log_force) == pytest.approx(0.1, abs=0.1)
    assert found.scales.colour.period[[V, R]] == pytest.approx(
        period * (data.ship.L / 130.0) ** 0.5 / data.dt, rel=0.25
    )


@pytest.mark.long
def test_a_cause_is_seen_through_a_swell(monkeypatch):
    monkeypatch.setattr(shipbench.simulate.trials, "WAVE_PERIOD", 16.0)
    hidden = [Hidden(EFFECTS.get("rudder_offset"), (0.03,))]
    found = diagnose(sea_trials(load_mmg_ship("container130"), 11, hidden, Trials(runs=12, waves=0.5)), gain=False)
    (cause,) = found.causes
    assert cause.effect == "rudder_offset"
    assert cause.parameters["offset"].value == pytest.approx(0.03, abs=0.005)


@pytest.mark.long
def test_velocities_filtered_in_the_earths_axes_are_seen_and_put_back(trials, filtered):
    found = late_velocities_of(filtered)
    assert found is not None
    late, mended_runs = found
    assert late.delay == pytest.approx(LATE, rel=0.2)
    assert min(late.score, late.over_position) > 50.0
    assert late.filtered
    assert [len(r) for r in mended_runs.runs] == [
        len(r) - 2 * int(np.ceil(late.delay / filtered.dt)) for r in filtered.runs
    ]
    assert late_velocities_of(mended_runs) is None
    edge = int(np.ceil(late.delay / filtered.dt))
    for mended, recorded, true in zip(mended_runs.runs, filtered.runs, trials.runs, strict=True):
        fast = true.states[edge:-edge, U]
        assert np.abs(mended.states[:, U] - fast).mean() < np.abs(recorded.states[edge:-edge, U] - fast).mean()


@pytest.mark.long
def test_velocities_that_are_late_without_a_filter_are_told_from_filtered_ones(trials):
    by = int(LATE / trials.dt)

    def change(S: np.ndarray) -> None:
        turn = np.exp(1j * S[:, PSI])
        earth = (S[:, U] + 1j * S[:, V]) * turn
        earth[by:] = earth[:-by].copy()
        S[:, U], S[:, V] = (earth * np.conj(turn)).real, (earth * np.conj(turn)).imag

    found = late_velocities_of(_changed(trials, change))
    assert found is not None
    late, _ = found
    assert not late.filtered
    assert late.delay == pytest.approx(LATE, rel=0.2)


def test_clocks_that_agree_or_a_late_position_are_left_to_the_model(trials):
    assert late_velocities_of(trials) is None
    by = int(LATE / trials.dt)

    def late(S: np.ndarray) -> None:
        S[by:, :2] = S[:-by, :2].copy()

    behind = _changed(trials, late)
    assert (
        late_velocities_of(
            behind.with_runs([replace(r, t=r.t[by:], states=r.states[by:], inputs=r.inputs[by:]) for r in behind.runs])
        )
        is None
    )


@pytest.mark.parametrize(("scatter", "late"), [(60.0, True), (1.0, False)])
def test_a_position_that_is_early_is_believed_only_where_the_runs_agree(
    filtered, monkeypatch, scatter: float, late: bool
):
    num = len(filtered.runs)
    early = 5.0 + scatter * np.resize([1.0, -1.0], num)
    shares = iter(
        [np.zeros(num), -np.ones(num), early, np.full(num, -50.0)]
    )  # filtered, late, position early, as recorded
    monkeypatch.setattr(clocks, "_evidence", lambda *_: next(shares))
    assert (late_velocities_of(filtered) is not None) is late


@pytest.mark.long
def test_filtered_velocities_are_named_first_and_nothing_else_is(filtered):
    verdict = diagnose(filtered, gain=False)
    assert verdict.causes[0].effect == "velocity_delay"
    delay = verdict.causes[0].parameters["delay"]
    assert delay.ci95[0] < delay.value < delay.ci95[1]
    assert verdict.causes[0].parameters["earth_axes"].value == 1.0
    assert len(verdict.causes) == 1
    position = next(c for c in verdict.candidates if c.effect == "position_delay")
    assert "corrected before the fit" in position.rejected_because


DELAYS = [
    ("velocity_delay", 0.0, 1.8, (0.5, 0.4), True), ("velocity_delay", 0.0, 1.2, (0.5, 0.4), False),
    ("velocity_delay", 0.0, 1.8, (1.4, 0.1), False),
    ("velocity_delay", 1.0, 1.8, (0.5, 0.4), False), ("position_delay", None, 1.8, (0.5, 0.4), True),
]  # fmt: skip


@pytest.mark.parametrize(("name", "earth", "delay", "track", "out"), DELAYS)
def test_a_delay_that_the_track_rules_out_is_none(
    trials, monkeypatch, name: str, earth: float | None, delay: float, track, out: bool
):
    """Of the forces of a supply vessel with nothing hidden; where the track shows a lag, or cannot tell, the forces are
    asked."""
    monkeypatch.setattr(clocks, "lags", lambda _: (track, (-1.9, 0.3) if earth else (0.1, 0.2)))
    term = Term(EFFECTS.get(name), () if earth is None else (earth,))
    plant = made_plant()
    typical = Scales(plant).amplitudes(term, plant.c.L)
    assert clocks.ruled_out(trials, made_fit((term,), (delay / typical,), plant)) == ((name,) if out else ())


@pytest.mark.long
def test_an_antenna_whose_velocities_are_its_own_is_no_other_hull(trials):
    """Track and velocities agree, so that only the forces tell where on the ship they belong; on a barge it was another
    hull (2716), and none."""

    def change(S: np.ndarray) -> None:
        arm = np.exp(1j * S[:, PSI]) * (-50.0 + 6.0j)
        S[:, X], S[:, Y] = S[:, X] + arm.real, S[:, Y] + arm.imag
        S[:, U], S[:, V] = S[:, U] - 6.0 * S[:, R], S[:, V] - 50.0 * S[:, R]

    verdict = diagnose(_changed(trials, change), gain=False)
    assert [c.effect for c in verdict.causes] == ["antenna_offset"]
    found = verdict.causes[0].parameters
    assert found["own_velocities"].value == 1.0
    for name, truth in (("forward", -50.0), ("starboard", 6.0)):
        low, high = found[name].ci95
        assert low < truth < high < truth + 60.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("channels", "named"), [pytest.param((U, V, R), ["velocity_delay"], marks=pytest.mark.long), ((R,), [])]
)
def test_a_late_yaw_rate_is_put_back_and_no_late_rudder(trials, channels: tuple[int, ...], named: list[str]):
    def change(S: np.ndarray) -> None:
        S[:] = delayed(S[None], channels, LATE, trials.dt)[0]

    found = diagnose(_changed(trials, change), gain=False)
    assert ([c.effect for c in found.causes], found.unknown) == (named, None)
    (told,) = [w for w in found.warnings if w.startswith("the yaw rate follows the heading")]
    assert float(re.search(r"\[delay\] r = ([\d.]+)\.", told)[1]) == pytest.approx(LATE, rel=0.1)
    assert not any("yaw rate" in w for w in diagnose(trials, gain=False).warnings)


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, pytest.param(7, marks=pytest.mark.long)])
def test_a_piece_in_which_the_ship_was_pushed_is_left_out_and_said_so(monkeypatch, seed: int):
    """The push drags the first fit so far that nothing looks strange where it ends."""
    trials = sea_trials(load_mmg_ship("kcs"), seed, (), Trials(runs=12, samples=120))
    row = THRESHOLDS.rows["segments_per_outlier"]
    monkeypatch.setitem(THRESHOLDS.rows, row.name, replace(row, value=20))  # a segment of 24; else it takes 100 of them
    assert not left_out(null_fit(Plant.of(trials), Scales(Plant.of(trials))).plant, trials.runs)
    pushed, push = 4, np.arange(20.0)
    states = [run.states.copy() for run in trials.runs]
    states[pushed][80:100, R] += 1e-3 * push
    states[pushed][80:100, PSI] += 0.5 * 1e-3 * push**2
    states[pushed][100:, PSI] += 0.5 * 1e-3 * 20.0**2
    data = trials.with_runs([replace(run, states=S) for run, S in zip(trials.runs, states, strict=True)])
    found = null_fit(Plant.of(data), Scales(Plant.of(data)))
    (line,) = left_out(found.plant, data.runs)
    assert f"run '{trials.runs[pushed].id}', 60 to 120 s" in line
    assert found.excess < 5.0


def test_actuators_of_a_piece_stand_where_the_commands_before_it_have_brought_them():
    data = replace(sea_trials(load_mmg_ship("kcs"), 3, (), Trials(runs=2, samples=120)), actuators="commanded")
    plant = Plant.of(data)
    slow = plant.ordinary["delta"]
    second = int(np.flatnonzero(plant.seg.start > 0)[0])
    run, begins = data.runs[plant.seg.run[second]], round(plant.seg.start[second] / data.dt)
    whole = gear_path(run.inputs[:1, 1], run.inputs[None, :, 1], data.dt, slow)[0]
    np.testing.assert_allclose(
        plant.path[second, :: plant.substeps, 0, 1], whole[begins : begins + plant.steps], atol=1e-4
    )
