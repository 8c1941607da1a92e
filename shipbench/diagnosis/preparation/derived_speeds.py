"""Speeds that are no measurements: derived from positions and headings by somebody before us. Counted as measurements they would say twice, and with
great certainty, what is known once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.fft import dct
from scipy.integrate import cumulative_trapezoid
from scipy.stats import chi2

from ...effects.base import EFFECTS
from ...records import Dataset, Run
from ...signals import PSI, R, U, V, X, Y
from .base import Prepared

_SLOW, _HOLLOW, _BY_CHANCE = 2, 0.5, 1e-4
"""Half swings along a run that count as slow; the share of the power at quick ones below which there is none (independent sensors: from 1 on, 4 to 40
in simulated trials, derived speeds 0.004 to 0.14), with few runs as low as chance alone hardly takes it."""
_LEAST_TRACK, _LEAST_HEADING = 0.02, np.deg2rad(0.02)
"""Quick errors [m at 130 m, rad] below which they are those of the integration."""
_LEAST_SAMPLES = 20


def marked(dataset: Dataset) -> Dataset:
    """The data set with the speeds that follow from its positions or headings among those that are `derived`.

    What such speeds sum up to lies beside the positions by their quick errors alone, as it follows the slow ones; the sums of a sensor's own errors
    are slow ones besides.
    """
    found = list(dataset.derived)
    if _hollow([beside_track(run) for run in dataset.runs], _LEAST_TRACK * dataset.ship.L / 130.0):
        found += ["u", "v"]
    if _hollow([beside_heading(run) for run in dataset.runs], _LEAST_HEADING):
        found.append("r")
    return replace(dataset, derived=tuple(dict.fromkeys(found)))


def mark_derived_speeds(prepared: Prepared) -> Prepared:
    """Mark speeds that follow from positions or headings as derived."""
    return replace(prepared, dataset=marked(prepared.dataset))


def faults_of_derived_speeds(prepared: Prepared) -> Prepared:
    """Exclude faults of sensors that are not there."""
    derived = prepared.dataset.derived
    if not derived:
        return prepared
    faulty = ((name, EFFECTS.get(name).traits.faults_of) for name in EFFECTS.names())
    absent = [name for name, channels in faulty if channels and channels <= set(derived)]
    names = " and ".join(", ".join(derived).rsplit(", ", 1))
    note = f"not counted as measured: {names}, derived from positions or headings, which they follow when summed up, errors and all."
    return replace(prepared, excluded=(*prepared.excluded, *absent), notes=(*prepared.notes, note))


def has_speeds(dataset: Dataset) -> bool:
    """Whether surge and sway are measured, so that the track can be held against them."""
    return not {"u", "v"} & set(dataset.derived)


def beside_track(run: Run) -> np.ndarray:
    """Positions less the summed-up velocities, (samples, 2) [m]."""
    psi, u, v = run.states[:, PSI], run.states[:, U], run.states[:, V]
    rates = np.column_stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
    return np.asarray(run.states[:, [X, Y]] - cumulative_trapezoid(rates, run.t, axis=0, initial=0.0))


def beside_heading(run: Run) -> np.ndarray:
    """Headings less the summed-up yaw rates, (samples, 1) [rad]."""
    return np.asarray(run.states[:, [PSI]] - cumulative_trapezoid(run.states[:, [R]], run.t, axis=0, initial=0.0))


def _hollow(errors: Sequence[np.ndarray], least: float) -> bool:
    """Whether the slowest swings of these series, (samples, signals) each, have far less power than quick ones."""
    powers = [dct(e, axis=0, norm="ortho") ** 2 for e in errors if len(e) >= _LEAST_SAMPLES]
    if not powers:
        return False
    slow, quick = np.array([p[1 : 1 + _SLOW] for p in powers]), np.mean([p[len(p) // 2 :].mean() for p in powers])
    share = min(_HOLLOW, chi2.ppf(_BY_CHANCE, slow.size) / slow.size)
    return bool(quick > least**2 and slow.mean() < share * quick)
