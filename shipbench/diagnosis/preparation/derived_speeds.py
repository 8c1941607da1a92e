"""Speeds that were derived from positions and headings before the import. Counted as measurements they would use the
same information twice, with too small a variance."""

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
from ..thresholds import THRESHOLDS
from .base import Prepared


def marked(dataset: Dataset) -> Dataset:
    """Data set with the speeds that follow from its positions or headings among those that are `derived`.

    The integral of such speeds differs from the positions by quick errors alone, as it follows the slow ones; the
    integral of a sensor's own errors has slow ones besides.
    """
    found = list(dataset.derived)
    least_track = THRESHOLDS.value("derived_least_track") * dataset.ship.L / 130.0
    if _hollow([beside_track(run) for run in dataset.runs], least_track):
        found += ["u", "v"]
    if _hollow([beside_heading(run) for run in dataset.runs], np.deg2rad(THRESHOLDS.value("derived_least_heading"))):
        found.append("r")
    return replace(dataset, derived=tuple(dict.fromkeys(found)))


def mark_derived_speeds(prepared: Prepared) -> Prepared:
    """Mark speeds that follow from positions or headings as derived."""
    return replace(prepared, dataset=marked(prepared.dataset))


def faults_of_derived_speeds(prepared: Prepared) -> Prepared:
    """Exclude sensor errors that derived speeds cannot have."""
    derived = prepared.dataset.derived
    if not derived:
        return prepared
    faulty = ((name, EFFECTS.get(name).traits.faults_of) for name in EFFECTS.names())
    absent = [name for name, channels in faulty if channels and channels <= set(derived)]
    names = " and ".join(", ".join(derived).rsplit(", ", 1))
    note = (
        f"not counted as measured: {names}, derived from positions or headings, which they follow when summed "
        "up, errors and all."
    )
    return replace(prepared, excluded=(*prepared.excluded, *absent), notes=(*prepared.notes, note))


def has_speeds(dataset: Dataset) -> bool:
    """Check whether surge and sway are measured, so that the track can be compared with them."""
    return not {"u", "v"} & set(dataset.derived)


def beside_track(run: Run) -> np.ndarray:
    """Positions less the integrated velocities, (samples, 2) [m]."""
    psi, u, v = run.states[:, PSI], run.states[:, U], run.states[:, V]
    rates = np.column_stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
    return np.asarray(run.states[:, [X, Y]] - cumulative_trapezoid(rates, run.t, axis=0, initial=0.0))


def beside_heading(run: Run) -> np.ndarray:
    """Headings less the integrated yaw rates, (samples, 1) [rad]."""
    return np.asarray(run.states[:, [PSI]] - cumulative_trapezoid(run.states[:, [R]], run.t, axis=0, initial=0.0))


def _hollow(errors: Sequence[np.ndarray], least: float) -> bool:
    """Check whether low frequencies of these series, (samples, signals) each, have far less power than high ones."""
    num_low = THRESHOLDS.count("derived_low_frequencies")
    powers = [dct(e, axis=0, norm="ortho") ** 2 for e in errors if len(e) >= 4 * num_low]
    if not powers:
        return False
    slow, quick = np.array([p[1 : 1 + num_low] for p in powers]), np.mean([p[len(p) // 2 :].mean() for p in powers])
    by_chance = chi2.ppf(THRESHOLDS.value("error_probability_of_many"), slow.size) / slow.size
    return bool(quick > least**2 and slow.mean() < by_chance * quick)
