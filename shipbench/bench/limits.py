"""Limits of predictions in Python: bands of models that were just fitted, and those of saved models."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import numbers
from ..errors import InputError
from ..predictors._band import Band, own_band, read_band
from ..predictors.base import History, make_predictor
from ..predictors.context import Context, predicted
from ..records import Dataset
from ..signals import MOTION, STATES
from ..specs import spec_of
from .bands import half_width
from .work import Job, band_of


def fit_band(
    model: Any, train: Dataset, valid: Dataset | None = None, *, seed: int = 0, history: int = 0,
    device: str | None = None,
) -> Band:  # fmt: skip
    """Fit a model five times more, each time without a fifth of its runs, and return its 90 % band.

    As the attribute `band` of a fitted model it is used by `predict_band`, and saved with models of shipbench. Its file
    is that of docs/formats.md; its method stands in docs/theory.md.

    Args:
        model: spec, class, or an object that is not fitted: it is copied, and its `fit` must begin anew.
        train, valid: windows of one length that the model is fitted to, as `Dataset.windows` cuts them.
        seed: of the fits.
        history: number of samples at the beginning of each window that `predict` is given as history.
        device: where networks compute: "cpu", "cuda" or "cuda:1".

    Raises:
        InputError: windows of different lengths or of fewer than nine groups of runs, a saved model, a fit that fails,
            or too many predictions that are not finite. An exception of `predict` passes through.
    """
    spec = spec_of(model)
    if spec.saved:
        raise InputError(
            f"fit_band: '{spec.text}' is a saved model, which is not fitted again. Give the spec that it was made of."
        )
    train.merged(valid).batch(history)  # refuses windows of different lengths
    band, reason = band_of(Job(spec, seed, {}, device=device), train, valid, history)
    if band is None:
        raise InputError(f"fit_band: {reason}. Accepted: a model that can be fitted to windows of nine groups or more.")
    return band


def predict_band(
    model: Any, s0: np.ndarray, U: np.ndarray, history: History | None = None, *,
    band: Band | str | os.PathLike[str] | None = None, context: Context | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Predict the lower and upper limits of the motion that is to be measured.

    They hold 90 % of the measurements on average over runs like those that the model was fitted to, not for each
    manoeuvre. On runs that it was fitted to they can be too wide.

    Args:
        model: folder of a saved model, or a fitted object with `predict`; its shape comes from its `predict_samples`,
            where it has that.
        s0: (batch, 10) or (10,), as in `predict`.
        U: (batch, K, inputs) or (K, inputs), as in `predict`, at the sample time of the band.
        history: states and inputs before s0, of as many samples as the band is made for, or None.
        band: what `fit_band` returned, or the folder in which a study kept it (for a model of your own); None: the
            model's own.
        context: given to a model whose `predict` has this argument.

    Returns:
        low, high: each (batch, K, 6) or (K, 6), x, y, psi, u, v, r in m, m, rad, m/s, m/s, rad/s. The heading is
        continuous as in `predict`. NaN beyond the band's horizon, and where the prediction is not finite.

    Raises:
        InputError: the model has no band or one for other predictions, its file is damaged, or an array has another
            shape.
    """
    name = str(model) if isinstance(model, str | os.PathLike) else type(model).__name__
    model = make_predictor(model) if isinstance(model, str | os.PathLike) else model
    found = _found(model, name, band)
    (s0, U, past), single = _batched(s0, U, history)
    if reason := found.misfit(model, 0 if past is None else past[0].shape[1]):
        raise InputError(f"the model {name}: {reason}. Give predictions like those of the band's study.")
    S = np.asarray(predicted(model, s0, U, past, context), dtype=float)
    if S.shape != (*U.shape[:2], len(STATES)):
        raise InputError(f"predict: shape {S.shape}; accepted: {(*U.shape[:2], len(STATES))} (batch, K, 10).")
    try:
        width = half_width(found, model, s0, U)
    except ValueError as error:
        raise InputError(str(error)) from None
    low, high = S[..., MOTION] - width, S[..., MOTION] + width
    return (low[0], high[0]) if single else (low, high)


def _found(model: Any, name: str, band: Band | str | os.PathLike[str] | None) -> Band:
    """Band that is given, or the model's own. Raises InputError where there is none."""
    place = f"the folder {band}" if isinstance(band, str | os.PathLike) else f"the model {name}"
    found = read_band(Path(band)) if isinstance(band, str | os.PathLike) else band or own_band(model)
    if found is None:
        raise InputError(
            f"{place} has no band. Accepted: a folder that `shipbench run --bands` saved, or "
            "band=shipbench.fit_band(model, train)."
        )
    return found


def _batched(
    s0: np.ndarray, U: np.ndarray, history: History | None
) -> tuple[tuple[np.ndarray, np.ndarray, History | None], bool]:
    """Arguments of `predict` with a batch axis, and whether it was added. Raises InputError for other shapes."""
    s0, U = numbers(s0, "s0"), numbers(U, "U")
    past = None if history is None else (numbers(history[0], "history"), numbers(history[1], "history"))
    if single := s0.ndim == 1:
        s0, U = s0[None], U[None]
        past = None if past is None else (past[0][None], past[1][None])
    fits = s0.ndim == 2 and s0.shape[1] == len(STATES) and U.ndim == 3 and len(U) == len(s0) and U.shape[1] > 0
    if not fits or (past is not None and (past[0].ndim, past[1].ndim) != (3, 3)):
        raise InputError(
            f"s0 has shape {s0.shape}, U {U.shape}{'' if past is None else f', history {past[0].shape}'}; accepted: "
            f"(batch, {len(STATES)}), (batch, K, inputs) and (batch, H, {len(STATES)}), or all without the batch."
        )
    return (s0, U, past), single
