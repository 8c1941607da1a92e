"""Upper bound of the diagnosis: power of a likelihood-ratio test with known effect, size, direction, noise and nuisance
parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...diagnosis.actuators.identify import find_in_gears
from ...diagnosis.preparation.plant import plant_of
from ...effects.base import Effect
from ...estimation.baseline import null_fit
from ...estimation.laplace import Fit, settle
from ...estimation.linearisation import Linearisation, Scales
from ...estimation.term import Term
from ...records import Dataset

LEVEL = 0.05


def expected_ratio(null: Fit, effect: Effect, values: Sequence[np.ndarray]) -> float:
    """Expected log likelihood ratio, doubled, of the baseline model against the one that holds `effect` with `values`
    (per parameter one number or one per run): the non-centrality lambda = c' V c of the test, with the prior
    differences between ships projected out.

    Source: docs/theory.md#evidence-of-a-cause; for actuator dynamics, whose effects show in the record of the actuator,
    the score of their own test.
    """
    plant = null.plant
    if effect.enters == "gear" and not plant.seg.commanded:
        return max([g.score for g in find_in_gears(plant)[0] if g.effect == effect.name], default=0.0)
    amplitudes = [
        np.broadcast_to(v, (plant.seg.runs,)) for v, p in zip(values, effect.parameters, strict=False) if not p.shape
    ]
    setting = tuple(
        float(np.ravel(v)[0]) for v, p in zip(values, effect.parameters, strict=False) if p.shape
    )  # a shape may be left out
    term = Term(effect, setting)
    c = np.stack(amplitudes, axis=-1) / null.scales.amplitudes(term, plant.c.L)
    fit = settle(
        Linearisation(plant, null.scales, null.point, null.motion),
        null.model,
        null.hyper,
        null.log_tau2,
        [term],
        cycles=0,
    )
    own, base = np.arange(fit.reduced.S.shape[1] - 1)[-term.size :], fit.prior.shared
    S = fit.reduced.S[:, :-1, :-1]
    direct = float(np.einsum("ni,nij,nj->", c, S[:, own][:, :, own], c))
    shared = np.einsum("nbi,ni->b", S[:, base][:, :, own], c)
    return direct - float(
        shared @ np.linalg.solve(S[:, base][:, :, base].sum(axis=0) + np.diag(fit.prior.precision), shared)
    )


def power(expected: float, level: float = LEVEL) -> float:
    """Power of this test at false alarms of `level`."""
    from scipy.stats import chi2, ncx2

    return float(ncx2.sf(chi2.isf(level, 1), 1, max(expected, 0.0)))


def bound(dataset: Dataset, hidden: Sequence[tuple[Effect, Sequence[np.ndarray]]]) -> float:
    """Power of the test for the hidden effect of least non-centrality."""
    plant = plant_of(dataset)
    null = null_fit(plant, Scales(plant))
    return min(power(expected_ratio(null, effect, values)) for effect, values in hidden)
