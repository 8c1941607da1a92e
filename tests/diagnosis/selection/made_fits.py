"""Fits whose estimates in each run are given."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from shipbench.diagnosis.inference.gram import Prior, Reduced
from shipbench.diagnosis.model.term import Term
from shipbench.effects.base import EFFECTS

RUNS = 20
_NONE = np.zeros(0, dtype=int), np.zeros(0)


def _reduced(S: np.ndarray) -> Reduced:
    return Reduced(S, np.zeros(len(S)), np.zeros(0), np.zeros(0))


def fit_of(
    estimates: np.ndarray, since: int | None = None, effect: str = "rudder_offset", setting: tuple[float, ...] = ()
) -> SimpleNamespace:
    """Runs (N,) with information 9 each on every amplitude, whose own least squares estimates of the first are given,
    of others 0; prior N(0, 1)."""
    term, information, num = Term(EFFECTS.get(effect), setting, since=since), 9.0, len(estimates)
    S = np.zeros((num, term.size + 1, term.size + 1))
    S[:] = np.diag(np.append(np.full(term.size, information), 1.0))
    S[:, 0, -1], S[:, -1, 0] = information * estimates, information * estimates
    cov = np.eye(term.size) / (1.0 + num * information)
    mean = cov[0] * information * estimates.sum()
    at, typical = np.arange(term.size), np.array([p.typical for p in term.effect.parameters if not p.shape])
    return SimpleNamespace(
        reduced=_reduced(S), solution=SimpleNamespace(mean=mean, cov=cov), prior=Prior(at, np.ones(term.size), *_NONE),
        values=(mean,),
        columns_of=lambda index: at, plant=SimpleNamespace(seg=SimpleNamespace(runs=num), c=SimpleNamespace(L=130.0)),
        model=SimpleNamespace(terms=(term,)), scales=SimpleNamespace(amplitudes=lambda *_: typical),
    )  # fmt: skip
