"""Velocities that are late as a vector in the earth's axes: filtered there by a receiver, then rotated by the current
heading.

Kinematics alone show it, over windows of many samples. It is corrected before any model is fitted: segments of a minute
do not contain the earlier samples, and it hides every other sensor error.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ...checking.recording import Recording
from ...checking.track import keeps_time, lags, late_velocities, may_be_none
from ...checking.yaw import late_yaw_rate
from ...data.corrections import undelayed
from ...effects.base import EFFECTS, Effect
from ...estimation.budget import is_spent
from ...estimation.gauss_newton import Origin, fit
from ...estimation.gram import by_run
from ...estimation.laplace import Fit, Model
from ...estimation.linearisation import Scales
from ...records import Dataset, Run
from ...signals import PSI, STATES, U, V
from ..thresholds import standard_errors
from .base import LateVelocities, Prepared
from .derived_speeds import has_speeds
from .plant import plant_of


def correct_late_velocities(prepared: Prepared) -> Prepared:
    """Shift velocities back in time that are late as a vector, and exclude the delays that kinematics answer: all once
    the clocks are corrected, or where measured speeds and the track show none."""
    dataset = prepared.dataset
    if not has_speeds(dataset):
        return prepared
    found = late_velocities_of(dataset)
    if found is not None:
        late, corrected = found
        return replace(prepared, dataset=corrected, late=late, excluded=(*prepared.excluded, *late_effects()))
    return (
        replace(prepared, excluded=(*prepared.excluded, *late_effects()))
        if keeps_time(Recording(dataset))
        else prepared
    )


def late_velocities_of(dataset: Dataset) -> tuple[LateVelocities, Dataset] | None:
    """Late velocities and the corrected runs, if the track shows them and the baseline model agrees that the velocities
    are late, not the position early."""
    found = late_velocities(Recording(dataset))
    if found is None:
        return None
    delay, sd = found
    sharp, noise_gain = unfiltered(dataset, delay)
    ways = {
        "filtered": put_back(sharp, {}, delay), "late": put_back(dataset, {"velocity": delay}, delay),
        "position": put_back(dataset, {"x": -delay, "y": -delay}, delay), "as recorded": put_back(dataset, {}, delay),
    }  # fmt: skip
    shares = {name: _evidence(runs, noise_gain if name == "filtered" else 1.0) for name, runs in ways.items()}
    if is_spent():  # fits that were stopped are not to be compared
        return None
    best = max(("filtered", "late"), key=lambda name: np.sum(shares[name]))
    over, over_position = (shares[best] - shares[other] for other in ("as recorded", "position"))
    # a position cannot be early, only all else late: that is believed where the runs agree
    sure = standard_errors("error_probability") * len(over) ** 0.5 * np.std(over_position)
    if np.sum(over) < 0.0 or -np.sum(over_position) > sure:
        return None
    return LateVelocities(
        delay, sd, best == "filtered", 2.0 * float(np.sum(over)), 2.0 * float(np.sum(over_position))
    ), ways[best]


def late_effects() -> tuple[str, ...]:
    """Names of the delays that kinematics may answer."""
    return tuple(name for name in EFFECTS.names() if EFFECTS.get(name).late)


def late_velocities_effect() -> Effect:
    """Delay of both velocities together, as an effect."""
    return next(e for e in map(EFFECTS.get, late_effects()) if e.traits.faults_of == {"u", "v"})


def ruled_out(dataset: Dataset, found: Fit) -> tuple[str, ...]:
    """Delays of a model that the track rules out: another channel is late."""
    late = [i for i, t in enumerate(found.model.terms) if t.effect.late and t.since is None]
    seen = lags(Recording(dataset)) if late and has_speeds(dataset) else None
    if seen is None:
        return ()
    own, position = seen
    out = []
    for i in late:
        term = found.model.terms[i]
        delay = float((found.values[i] * found.scales.amplitudes(term, found.plant.c.L))[0])
        lag, sd = own if term.effect.traits.faults_of == {"u", "v"} else position
        if any(term.setting):  # velocities that are late in the earth's axes are a position that is early
            lag, sd = -position[0], position[1]
        if may_be_none((lag, sd)) and abs(delay - lag) > standard_errors("error_probability") * sd:
            out.append(term.label)
    return tuple(out)


def correct_late_yaw_rate(prepared: Prepared) -> Prepared:
    """Shift a yaw rate back in time that is late against the heading. A heading cannot be early. Uncorrected, a rudder,
    or any other cause of turning, would seem to be late."""
    dataset = prepared.dataset
    found = None if "r" in dataset.derived else late_yaw_rate(Recording(dataset))
    if found is None:
        return prepared
    delay, sd = found
    line = (
        f"the yaw rate follows the heading {delay:.2g} s late (standard error {sd:.1g} s, by kinematics). It "
        "is corrected before any cause "
        f"is searched; in dataset.toml: [delay] r = {delay:.3g}."
    )
    return prepared.corrected(put_back(dataset, {"r": delay}, 0.0), line)


def put_back(dataset: Dataset, delay: dict[str, float], ends: float) -> Dataset:
    """Runs with late signals shifted back in time, less `ends` seconds at both ends; runs with fewer than 3 samples
    left are left out."""
    runs = []
    for run in dataset.runs:
        names = (*STATES, *run.inputs_names)
        frame = pd.DataFrame({"t": run.t} | dict(zip(names, np.column_stack([run.states, run.inputs]).T, strict=True)))
        frame = undelayed(frame, delay, dataset.dt)
        inside = (frame["t"] >= run.t[0] + ends - 1e-6) & (frame["t"] <= run.t[-1] - ends + 1e-6)
        values = frame[inside].to_numpy()
        if len(values) >= 3:
            runs.append(
                replace(run, t=values[:, 0], states=values[:, 1 : 1 + len(STATES)], inputs=values[:, 1 + len(STATES) :])
            )
    return dataset.with_runs(runs)


def unfiltered(dataset: Dataset, delay: float) -> tuple[Dataset, float]:
    """Velocities before a filter y_k = a y_{k-1} + (1 - a) x_k of that mean delay, a dt / (1 - a), and the gain 1 / (1
    - a) by which each sample is amplified."""
    keep = delay / (delay + dataset.dt)

    def sharpened(run: Run) -> Run:
        states = run.states.copy()
        turn = np.exp(1j * states[:, PSI])
        earth = (states[:, U] + 1j * states[:, V]) * turn
        earth[1:] = (earth[1:] - keep * earth[:-1]) / (1.0 - keep)
        own = earth * np.conj(turn)
        states[:, U], states[:, V] = own.real, own.imag
        return replace(run, states=states)

    return dataset.with_runs([sharpened(run) for run in dataset.runs]), 1.0 / (1.0 - keep)


def _evidence(dataset: Dataset, noise_gain: float) -> np.ndarray:
    """Log evidence (N,) by run of the baseline model for the recorded samples, where those of u and v were amplified by
    `noise_gain`."""
    plant = plant_of(dataset)
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    found = fit(plant, scales, Model(), origin.point, origin.hyper, guess=origin.motion, far=True)
    samples = by_run(plant.seg.mask.sum(axis=1), plant.seg.run)
    return found.solution.per_run + 2.0 * samples * float(np.log(noise_gain))
