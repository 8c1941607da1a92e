"""90 % bands of any model, from its errors on runs that it was not fitted to: cross-conformal prediction.

The training and validation runs are dealt into `PARTS` parts by group. The model is fitted once without each part, and
its errors there are divided by the shape of the band. Their quantile at each time step and channel is the factor of the
band. It is the quantile of one more group: with G groups, each counts 1 / (G + 1), and so the band needs 9 of them.

Assumption: groups of runs are exchangeable, those to be predicted as those fitted. The windows of a group need not be
independent. A band is right on average over such runs, not for each manoeuvre.

Source: Vovk, Cross-conformal predictors, Ann. Math. Artif. Intell. 74 (2015) 9-28; for groups, Dunn, Wasserman, Ramdas,
Distribution-free prediction sets for two-layer hierarchical models, JASA 118 (2023) 2491-2502, section 3.1.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..predictors._band import Band, own_band
from ..records import Dataset, Run
from ..signals import MOTION

COVERAGE = 0.9
"""Share of the measurements that a band is to hold."""
PARTS = 5
"""Parts that the runs are dealt into; the model is fitted once without each."""
LEAST_GROUPS = 9
"""Groups of runs that a band of 90 % needs: with fewer, G / (G + 1) is below it."""
_SAMPLES = 100
"""Random records from which a model of its own `predict_samples` takes the shape of its band."""


def without_parts(train: Dataset, valid: Dataset | None) -> list[tuple[Dataset, Dataset | None, Dataset]]:
    """Data for each further fit: training and validation runs without a part, and the part. Groups stay whole, and
    every part has its share of the validation runs.

    Returns an empty list where the runs are of fewer than `LEAST_GROUPS` groups.
    """
    groups: dict[str, int] = {}
    for run in (*(valid.runs if valid else ()), *train.runs):
        groups.setdefault(run.group, len(groups))
    if len(groups) < LEAST_GROUPS:
        return []
    whole, found = train.merged(valid), []
    for part in range(PARTS):

        def out(run: Run, part: int = part) -> bool:
            return groups[run.group] % PARTS == part

        kept = [run for run in valid.runs if not out(run)] if valid else []
        found.append(
            (
                train.with_runs(run for run in train.runs if not out(run)),
                train.with_runs(kept) if kept else None,
                train.with_runs(run for run in whole.runs if out(run)),
            )
        )
    return found


def band_shape(model: Any, s0: np.ndarray, U: np.ndarray) -> np.ndarray:
    """Half-widths (batch, K, 6) of the motion before they are scaled: of the middle 90 % of the model's own
    `predict_samples`, or 1 for a model without it. NaN where no sample is known.

    Raises:
        ValueError: the samples have another shape.
    """
    if not callable(getattr(model, "predict_samples", None)):
        return np.ones((*U.shape[:2], 6))
    drawn = np.asarray(model.predict_samples(s0, U, _SAMPLES), dtype=float)
    batch, K = U.shape[:2]
    if drawn.ndim != 4 or drawn.shape[1:3] != (batch, K) or drawn.shape[3] < 6:
        raise ValueError(f"predict_samples: shape {drawn.shape}; accepted: (samples, {batch}, {K}, 6 or 10).")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of values that no sample knows
        low, high = np.nanquantile(drawn[..., MOTION], [(1.0 - COVERAGE) / 2.0, (1.0 + COVERAGE) / 2.0], axis=0)
    return np.asarray(high - low) / 2.0


def band_factor(ratios: np.ndarray, groups: Sequence[str]) -> np.ndarray:
    """Factors (K, 6) of the shape: the quantile of `COVERAGE` over groups.

    Args:
        ratios: (windows, K, 6) absolute error over shape, on runs that the model was not fitted to; a value that is not
            finite counts as larger than all others.
        groups: group of each window.

    Returns infinity where the quantile exceeds every finite ratio.
    """
    names, at, counts = np.unique(np.asarray(groups), return_inverse=True, return_counts=True)
    weight = 1.0 / (counts[at] * (len(names) + 1.0))
    sized = np.where(np.isfinite(ratios), ratios, np.inf)
    order = np.argsort(sized, axis=0)
    reached = np.cumsum(weight[order], axis=0) >= COVERAGE - 1e-12
    first = np.take_along_axis(sized, np.take_along_axis(order, reached.argmax(axis=0)[None], axis=0), axis=0)[0]
    return np.asarray(np.where(reached.any(axis=0), first, np.inf))


def half_width(band: Band, model: Any, s0: np.ndarray, U: np.ndarray) -> np.ndarray:
    """Half-widths (batch, K, 6) of the band of a fitted model about the motion that it predicts; NaN beyond the band's
    horizon, and where no sample of `predict_samples` is known.

    Raises:
        ValueError: the samples have another shape (see `band_shape`).
    """
    known = min(U.shape[1], len(band.factor))
    width = np.full((*U.shape[:2], 6), np.nan)
    width[:, :known] = band.factor[:known] * band_shape(model, s0, U[:, :known])
    return width


def saved_band(model: Any, steps: int, history: int, dt: float) -> tuple[Band | None, str]:
    """Band that a saved model has, for predictions of `steps` time steps of `dt` [s] with `history` samples before the
    start; or None and the reason."""
    band = own_band(model)
    if band is None:
        return None, "a saved model is not fitted again, and this one was saved without a band"
    if steps > len(band.factor):
        return None, f"the band of the saved model has {len(band.factor)} time steps, the horizon {steps}"
    reason = band.misfit(model, history, dt)
    return (None, reason) if reason else (band, "")
