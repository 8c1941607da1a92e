"""Dependence of a cause's values in single runs on the place where a run was sailed, or on its number."""

from __future__ import annotations

import numpy as np

from ...estimation.forward import Segments
from ...estimation.laplace import Fit
from ..thresholds import THRESHOLDS


def of_runs(fit: Fit, index: int) -> np.ndarray:
    """Values (runs, components) of the index-th cause, which has one for each run; a vector by its components."""
    term = fit.model.terms[index]
    effect, value = term.effect, fit.values[index] * fit.scales.amplitudes(term, fit.plant.c.L)
    if effect.vector is None:
        return value
    size, towards = np.array([tuple(effect.public(row).values()) for row in value]).T
    return np.stack([size * np.cos(towards), size * np.sin(towards)], axis=1)


def goes_with(seg: Segments, values: np.ndarray) -> str:
    """Sentence on the variable with which `values` (runs, components) correlate, with the share of the variance; empty
    if none."""
    weight = np.maximum(np.bincount(seg.run, seg.mask.sum(axis=1), minlength=seg.runs), 1.0)
    x, y = (
        np.bincount(seg.run, np.sum(seg.states[..., i] * seg.mask, axis=1), minlength=seg.runs) / weight for i in (0, 1)
    )
    found = [
        (_chance(values, at), words)
        for at, words in ((np.stack([x, y], axis=1), "place"), (np.arange(seg.runs)[:, None], "number"))
    ]
    (chance, share), words = min(found, key=lambda f: f[0][0])
    if chance > THRESHOLDS.value("error_probability_of_many"):
        return ""
    told = "from place to place" if words == "place" else "with time"
    return f"it differs {told}: {share:.0%} of the variance of its values depends on the {words} of the runs"


def _chance(values: np.ndarray, at: np.ndarray) -> tuple[float, float]:
    """p-value of the F test of `values` (N, C) on a line in `at` (N, K), and its share of the variance."""
    from scipy.stats import f

    (N, C), K = values.shape, at.shape[1]
    total = float(np.sum((values - values.mean(axis=0)) ** 2))
    if N < K + 4 or total == 0.0:
        return 1.0, 0.0
    A = np.column_stack([np.ones(N), (at - at.mean(axis=0)) / np.maximum(at.std(axis=0), 1e-12)])
    left = values - A @ np.linalg.lstsq(A, values, rcond=None)[0]
    share = 1.0 - float(np.sum(left**2)) / total
    return float(f.sf(share / K / max((1.0 - share) / (N - K - 1), 1e-12), K * C, (N - K - 1) * C)), share
