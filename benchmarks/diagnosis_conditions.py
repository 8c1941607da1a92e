"""The diagnosis under other conditions than those of its suite: another quality or length of the record, less known of
the ship. About 20 minutes.

    python benchmarks/diagnosis_conditions.py [--runs DRAWS] [--only CONDITION ...] [--quick] [--json FILE]

Seven ships (drawn variants of KCS and KVLCC2; Mariner, a tanker, S175 and a navy ship in their authors' equations).
Under every condition each of them sails once with nothing hidden, where nothing must be named, and once with a cause
that any ship shows, which must be named first.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context

import measure
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt
from seven_ships import SHIPS, trials

from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.records import Dataset, Run
from shipbench.ship import Ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import NOISE, Trials

PLANS = {
    "as in the suite": Trials(),
    "no noise, no gusts": Trials(noise=0.0, gusts=0.0),
    "no gusts": Trials(gusts=0.0),
    "three times the noise": Trials(noise=3.0),
    "6 runs of 600 samples": Trials(runs=6, samples=600),
    "90 runs of 40 samples": Trials(runs=90, samples=40),
    "ahead, without thrusters": Trials(astern=False, thrusters=False),
}
HIDDEN = {"current": (0.3, 0.2), "wind": (8.0, 3.0), "rudder_offset": (0.03,), "heading_bias": (-0.03,)}
"""Sizes for a ship of 130 m; speeds scale with the root of the length."""


def every(num: int) -> Callable[[Dataset], Dataset]:
    """Every num-th sample."""

    def thin(data: Dataset) -> Dataset:
        runs = tuple(replace(r, t=r.t[::num], states=r.states[::num], inputs=r.inputs[::num]) for r in data.runs)
        return replace(data, runs=runs, dt=data.dt * num)

    return thin


def quick_samples(data: Dataset) -> Dataset:
    """Five samples for one, with noise of their own (the plan has none); actuators move steadily between theirs."""
    rng, noise = np.random.default_rng(1), NOISE

    def finer(run: Run) -> Run:
        t = np.arange(5 * (len(run) - 1) + 1) * data.dt / 5
        held = np.minimum(np.arange(len(t)) // 5, len(run) - 1)
        motion, actuators = (
            CubicSpline(run.t, run.states[:, :6])(t),
            [np.interp(t, run.t, a) for a in run.states[:, 6:].T],
        )
        states = np.column_stack([motion, *actuators]) + noise * rng.standard_normal((len(t), 10))
        return replace(run, t=t, states=states, inputs=run.inputs[held])

    return replace(data, runs=tuple(finer(r) for r in data.runs), dt=data.dt / 5)


def wandering(data: Dataset) -> Dataset:
    """A receiver whose position wanders by 1 m within 20 s."""
    rng, scale = np.random.default_rng(1), (data.ship.L / 130.0) ** 0.5
    keep = np.exp(-data.dt / (20.0 * scale))

    def off(run: Run) -> Run:
        path = scale**2 * rng.standard_normal((len(run), 2))
        for i in range(1, len(run)):
            path[i] = keep * path[i - 1] + np.sqrt(1.0 - keep**2) * path[i]
        return replace(run, states=run.states + np.pad(path, ((0, 0), (0, 8))))

    return data.with_runs([off(r) for r in data.runs])


def rounded(data: Dataset) -> Dataset:
    """What a display shows: 0.1 m, 0.1 deg, 0.01 m/s, 0.01 deg/s, 1 rpm, 0.5 deg of rudder, 1 kN."""
    step = np.array([0.1, 0.1, np.deg2rad(0.1), 0.01, 0.01, np.deg2rad(0.01), 1.0, np.deg2rad(0.5), 1e3, 1e3])
    return data.with_runs([replace(r, states=np.round(r.states / step) * step) for r in data.runs])


def low_passed(data: Dataset) -> Dataset:
    """Motion behind a Butterworth filter of second order, forth and back, 6 dB down at 10 s on a ship of 130 m."""
    smooth = butter(2, 2.0 * data.dt / (10.0 * (data.ship.L / 130.0) ** 0.5), output="sos")

    def filtered(run: Run) -> Run:
        motion = np.column_stack([run.states[:, :2], np.unwrap(run.states[:, 2]), run.states[:, 3:6]])
        return replace(run, states=np.hstack([sosfiltfilt(smooth, motion, axis=0), run.states[:, 6:]]))

    return data.with_runs([filtered(r) for r in data.runs])


def bare(data: Dataset) -> Dataset:
    """A ship file of main dimensions (and places of thrusters)."""
    own = data.ship
    return replace(
        data,
        ship=Ship(name=own.name, L=own.L, B=own.B, T=own.T, displacement=own.displacement, thrusters=own.thrusters),
    )


def commands(data: Dataset) -> Dataset:
    """No actuator is recorded."""
    runs = [replace(r, states=np.concatenate([r.states[:, :6], r.inputs[:, :4]], axis=1)) for r in data.runs]
    return replace(data.with_runs(runs), actuators="commanded")


CHANGES: dict[str, tuple[Trials, Callable[[Dataset], Dataset] | None]] = {
    "every 2nd sample": (Trials(), every(2)),
    "every 4th sample": (Trials(), every(4)),
    "5 samples for one": (Trials(noise=0.0), quick_samples),
    "wandering position": (Trials(), wandering),
    "rounded as on displays": (Trials(), rounded),
    "main dimensions alone": (Trials(), bare),
    "commands alone": (Trials(), commands),
    "motion in waves": (Trials(waves=1.0), None),
    "standard manoeuvres": (Trials(runs=10, samples=600, standard=True), None),
    "low-pass filtered": (Trials(), low_passed),
    "5 standard manoeuvres": (Trials(runs=5, samples=600, standard=True), None),
    "8 standard manoeuvres of 400 s": (Trials(runs=8, samples=400, standard=True), None),
}
CONDITIONS = [*PLANS, *CHANGES]


def outcome(job: tuple[str, int, str], draw: int) -> tuple[str, list[str]]:
    """Verdict and names, for (condition, ship, what is hidden)."""
    condition, number, name = job
    plan, change = CHANGES.get(condition, (PLANS.get(condition), None))
    seed = 1000 * draw + 10 * CONDITIONS.index(condition) + number
    hidden = [Hidden(EFFECTS.get(name), HIDDEN[name])] if name else []
    data = trials(number, draw, seed, hidden, plan)
    found = diagnose(change(data) if change else data, gain=False)
    return found.verdict, [c.effect for c in found.causes if c.effect != "hull_derivatives"]


def main() -> None:
    """One line a condition, and what was wrong."""
    given = measure.options(__doc__, runs=1, cases=CONDITIONS)
    measure.header(given)
    conditions = given.only or (CONDITIONS[-1:] if given.quick else CONDITIONS)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for condition in conditions:
            for draw in range(given.runs):
                first = CONDITIONS.index(condition) + draw
                causes = [list(HIDDEN)[(first + number) % len(HIDDEN)] for number in range(len(SHIPS))]
                jobs = [(condition, number, name) for number, cause in enumerate(causes) for name in ("", cause)]
                found = dict(zip(jobs, pool.map(partial(outcome, draw=draw), jobs), strict=True))
                silent = [j for j in jobs if not j[2] and found[j][0] == "none"]
                right = [j for j in jobs if j[2] and found[j][1][:1] == [j[2]]]
                odd = [j for j in jobs if j not in silent and j not in right]
                wrong = [f"ship {j[1]}, {j[2] or 'nothing'}: {', '.join(found[j][1]) or found[j][0]}" for j in odd]
                measure.record(
                    given,
                    {
                        "condition": condition,
                        "draw": draw,
                        "silent": len(silent),
                        "right": len(right),
                        "of": len(SHIPS),
                        "wrong": wrong,
                    },
                )
                score = (
                    f"of {len(SHIPS)} without a cause {len(silent)} none, of {len(SHIPS)} with one {len(right)} right"
                )
                print(f"{condition}: {score}", *wrong, sep="; ", flush=True)


if __name__ == "__main__":
    main()
