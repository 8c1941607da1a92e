"""Work of a worker: fit the cells of one job and predict. It scores nothing and writes no result; no truth reaches it.

A job holds the cells that are fitted together: all folds of one model, data set and seed where the model's class offers
`fit_group`, else one cell. Stacked training rounds differently with other members beside it, so a job is the unit that
is sent, killed and resumed: its numbers then do not depend on where and in which order jobs run.
"""

from __future__ import annotations

import hashlib
import json
import random
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ShipbenchError
from ..metrics.base import state_error
from ..predictors._band import Band
from ..predictors._user_file import code_of, files_read, on_import_path
from ..predictors.base import History, make_predictor
from ..predictors.context import Context, predicted
from ..predictors.physics_model.fit_report import FitReport
from ..predictors.predictions import ReplayReport
from ..records import Dataset
from ..signals import MOTION
from ..specs import Spec
from .bands import COVERAGE, LEAST_GROUPS, band_factor, band_shape, half_width, saved_band, without_parts
from .cost import count_parameters
from .provenance import machine
from .results import EQUATIONS, beside_model

_RAISED = BaseException
"""Exceptions that a model may raise and that fail its own rows only (after `_let_stop_through`): also asyncio's
CancelledError and an exit."""


@dataclass(frozen=True, eq=False)
class FoldData:
    """Data of a fold that a model may see: windows for fitting and for early stopping, and start, inputs, history and
    context of the scored windows.

    `before`: windows for a first fit and its early stopping, from which the fit goes on (a warm start).
    """

    train: Dataset
    valid: Dataset | None
    s0: np.ndarray
    U: np.ndarray
    history: History | None
    context: Context | None = None
    before: tuple[Dataset, Dataset | None] | None = None

    @property
    def fits(self) -> list[tuple[Dataset, Dataset | None]]:
        """Training and validation data of the fits, one after the other."""
        return [*([self.before] if self.before else []), (self.train, self.valid)]


@dataclass(frozen=True)
class Job:
    """Model and seed, to be fitted on one or several folds.

    `code`: digests of the packages that it takes (`package_digest`). `files`: content by relative name of the user's
    code or saved folder, where the worker may not have it; None: it is read in place. `device`: where it computes,
    unless its spec says. `foreign`: it runs code that is not shipbench's, so that it needs a process of its own.
    `bands`: the answer has a 90 % band (see `bands`).
    """

    spec: Spec
    seed: int
    code: dict[str, str]
    files: dict[str, bytes] | None = None
    device: str | None = None
    foreign: bool = False
    bands: bool = False


@dataclass(frozen=True, eq=False)
class Answer:
    """Result of a cell.

    Args:
        status: "" (predicted, to be scored), "failed" or "skipped", with the `reason`.
        skipped: reason for each row (batch,) why it was not predicted, "" where it was; () where all rows were.
        S: prediction (batch, K, 10), or None.
        W: half-widths (batch, K, 6) of the 90 % band about the motion of S; NaN where there is no band. None where the
            job asks for none.
        fit_s: time of the fit [s], shared equally by the `shared_by` cells that were fitted together.
        predict_s: time of one rollout [s].
        params: the model's settings, or None if it does not state them.
        parameters: count of the fitted numbers (see `cost`), or None if it is unknown.
        files: saved model and fitted equations, content by relative name.
        notes: reason why the model could not be saved or described, its error on its own training runs
            (`fit_report`), whether it learns nothing
            from them, and the data set that it knows.
        machine: where it was computed.
        code: digests by relative name of the user's code that was loaded in the end, and of the files that the model
            read; empty for other models.
    """

    status: str = ""
    reason: str = ""
    S: np.ndarray | None = None
    fit_s: float = 0.0
    shared_by: int = 1
    predict_s: float = 0.0
    params: dict[str, Any] | None = None
    parameters: int | None = None
    files: dict[str, bytes] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=machine)
    code: dict[str, str] = field(default_factory=dict)
    W: np.ndarray | None = None
    skipped: tuple[str, ...] = ()


def work(job: Job, folds: Sequence[FoldData]) -> list[Answer]:
    """Fit and predict; an exception of the model becomes the answer of its cells (one for each of `folds`)."""
    try:
        with _at_hand(job) as spec:
            if spec.path is None or spec.class_name is None:
                return _work(replace(job, spec=spec), folds)
            with (
                on_import_path(spec.path),
                files_read(spec.path.parent.absolute(), Path.cwd()) as read,
            ):  # a model may import as late as in `predict`
                answers = _work(replace(job, spec=spec), folds)
            code = {name: file_digest(file) for name, file in read.items()} | digests(code_of(spec.path))
            return [replace(answer, code=code) for answer in answers]
    except _RAISED as error:
        _let_stop_through(error)
        return [Answer("failed", one_line(error)) for _ in folds]


def digests(files: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of each file."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}


def file_digest(file: Path) -> str:
    """SHA-256 of a file of any size."""
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _let_stop_through(error: BaseException) -> None:
    """Raise KeyboardInterrupt where that is behind the exception: Lightning turns it into a SystemExit, which would
    count as a failed model."""
    behind: BaseException | None = error
    while behind is not None:
        if isinstance(behind, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        behind = behind.__context__


def one_line(error: BaseException) -> str:
    """Text of an exception as a reason for a row."""
    text = str(error) if isinstance(error, ShipbenchError) else f"{type(error).__name__}: {error}".removesuffix(": ")
    return " ".join(text.split())[:400]


@contextmanager
def _at_hand(job: Job) -> Iterator[Spec]:
    """Provide the job's spec, with the files behind it in a temporary folder where they were sent along."""
    if job.spec.path is None or job.spec.matched is not None:
        yield job.spec
        return
    if job.files is None:
        yield replace(job.spec, path=job.spec.path.absolute())  # also after a model has changed the working folder
        return
    with tempfile.TemporaryDirectory(prefix="shipbench-") as folder:
        for name, content in job.files.items():
            Path(folder, name).parent.mkdir(parents=True, exist_ok=True)
            Path(folder, name).write_bytes(content)
        yield replace(job.spec, path=Path(folder, job.spec.path.name))


def _work(job: Job, folds: Sequence[FoldData]) -> list[Answer]:
    model = make_predictor(job.spec, job.device)
    refusal = getattr(model, "skip", None)
    reason = refusal(folds[0].train) if callable(refusal) else None
    if reason:
        return [Answer("skipped", str(reason)) for _ in folds]
    _seed_global_draws(job.seed)
    fits = _fit(job, folds)
    answers = [_predicted(fit, fold) for fit, fold in zip(fits, folds, strict=True)]
    if not job.bands:
        return answers
    return [
        _with_band(answer, job, fit.model, fold) if answer.S is not None else answer
        for answer, fit, fold in zip(answers, fits, folds, strict=True)
    ]


def _seed_global_draws(seed: int) -> None:
    """Seed the global generators: a model that draws from them then draws the same in any order and place."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 - for models of others; ours draw from generators of their own
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(seed)


@dataclass(frozen=True, eq=False)
class _Fit:
    model: Any
    seconds: float
    shared_by: int = 1
    error: str = ""


def _fit(job: Job, folds: Sequence[FoldData]) -> list[_Fit]:
    """Fit the models of the folds: together where the class can, else one by one; a failure of one leaves the
    others."""
    spec, seed = job.spec, job.seed
    models = [make_predictor(spec, job.device) for _ in folds]
    if spec.saved:
        return [_Fit(model, 0.0) for model in models]  # a saved model comes fitted
    group, began = getattr(type(models[0]), "fit_group", None), time.perf_counter()
    if group is not None and len(folds) > 1:
        try:
            for parts in zip(*(fold.fits for fold in folds), strict=True):
                group(models, [train for train, _ in parts], [valid for _, valid in parts], [seed] * len(folds))
                _start_warm(models, folds)
            seconds = (time.perf_counter() - began) / len(folds)
            return [_Fit(model, seconds, len(folds)) for model in models]
        except _RAISED as error:  # one fold is enough to fail them all: each gets its chance alone
            _let_stop_through(error)
            models = [make_predictor(spec, job.device) for _ in folds]
    fits = []
    for model, fold in zip(models, folds, strict=True):
        began, reason = time.perf_counter(), ""
        try:
            for train, valid in fold.fits:
                model.fit(train, valid, seed=seed)
                _start_warm([model], [fold])
        except _RAISED as error:
            _let_stop_through(error)
            reason = f"fit: {one_line(error)}"
        fits.append(_Fit(model, time.perf_counter() - began, error=reason))
    return fits


def _start_warm(models: Sequence[Any], folds: Sequence[FoldData]) -> None:
    """Let the next fit of the models go on from this one, where their folds have two."""
    for model, fold in zip(models, folds, strict=True):
        if fold.before:
            model.warm_start = True


def _predicted(fit: _Fit, fold: FoldData) -> Answer:
    if fit.error:
        return Answer("failed", fit.error, fit_s=fit.seconds, shared_by=fit.shared_by)
    began = time.perf_counter()
    try:
        skipped = _skipped(fit.model, fold)
        if skipped and all(skipped):
            return Answer("skipped", skipped[0], fit_s=fit.seconds, shared_by=fit.shared_by)
        S = _predict(fit.model, fold)
        S[[i for i, reason in enumerate(skipped) if reason]] = np.nan
        predict_s = (time.perf_counter() - began) / len(S)
        params = (
            json.loads(json.dumps(asdict(fit.model), default=str))
            if is_dataclass(fit.model) and not isinstance(fit.model, type)
            else None
        )
    except _RAISED as error:
        _let_stop_through(error)
        return Answer("failed", f"predict: {one_line(error)}", fit_s=fit.seconds, shared_by=fit.shared_by)
    files, notes = _kept(fit.model)
    if isinstance(report := getattr(fit.model, "report", None), FitReport):
        notes["fit_report"] = report.as_dict()
    elif isinstance(report, ReplayReport):
        notes["replay_report"] = report.as_dict()
    if getattr(fit.model, "learns", True) is False:
        notes["learns"] = False
    if fitted_to := getattr(fit.model, "fitted_to", ""):
        notes["fitted_to"] = str(fitted_to)
    return Answer(
        "", "", S, fit.seconds, fit.shared_by, predict_s, params, count_parameters(fit.model), files, notes,
        skipped=skipped,
    )  # fmt: skip


def _skipped(model: Any, fold: FoldData) -> tuple[str, ...]:
    """Reason for each row why the model does not predict it, "" where it does; () where it predicts all.

    Raises:
        ValueError: the model gives another number of reasons.
    """
    if fold.context is None or not callable(getattr(model, "skip_windows", None)):
        return ()
    reasons = tuple(str(reason) for reason in model.skip_windows(fold.context, fold.U.shape[1]))
    if len(reasons) != len(fold.s0):
        raise ValueError(f"skip_windows gives {len(reasons)} reasons for {len(fold.s0)} rows; accepted: one for each")
    return reasons if any(reasons) else ()


def _with_band(answer: Answer, job: Job, model: Any, fold: FoldData) -> Answer:
    """Answer with the band of its prediction, also beside the saved model, or with a note on why it has none."""
    try:
        history = 0 if fold.history is None else fold.history[0].shape[1]
        if job.spec.saved:  # it comes fitted
            band, reason = saved_band(model, fold.U.shape[1], history, fold.train.dt)
        else:
            band, reason = band_of(job, fold.train, fold.valid, history)
        width = None if band is None else half_width(band, model, fold.s0.copy(), fold.U.copy())
    except _RAISED as error:
        _let_stop_through(error)
        band, width, reason = None, None, one_line(error)
    if band is None or width is None:
        return replace(answer, W=np.full((*fold.U.shape[:2], 6), np.nan), notes=answer.notes | {"no_band": reason})
    return replace(answer, W=width, files=beside_model(answer.files, band))


def band_of(job: Job, train: Dataset, valid: Dataset | None, history: int) -> tuple[Band | None, str]:
    """Band of a model that is fitted to these windows, from further fits without some of them, or None and the reason;
    `history` samples at the beginning of each are given to `predict`."""
    folds, truths, groups = [], [], list[str]()
    for kept, kept_valid, out in without_parts(train, valid):
        batch = out.batch(history)
        folds.append(FoldData(kept, kept_valid, batch.s0, batch.U, batch.history, Context.of(out, history)))
        truths.append(batch.truth)
        groups += [run.group for run in out.runs]
    if not folds:
        return None, f"the training and validation runs are of fewer than {LEAST_GROUPS} groups"
    _seed_global_draws(job.seed)
    ratios, asked, of_samples = [], list[bool](), False
    for fit, part, truth in zip(_fit(job, folds), folds, truths, strict=True):
        if fit.error:
            return None, f"without some of the runs, {fit.error}"
        asked += [not reason for reason in _skipped(fit.model, part) or ("",) * len(truth)]
        error = np.abs(state_error(truth, _predict(fit.model, part))[..., MOTION])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios.append(error / band_shape(fit.model, part.s0.copy(), part.U.copy()))
        of_samples = callable(getattr(fit.model, "predict_samples", None))
    predicted_groups = [group for group, wanted in zip(groups, asked, strict=True) if wanted]
    if len(set(predicted_groups)) < LEAST_GROUPS:
        return None, f"the training and validation runs that it predicts are of fewer than {LEAST_GROUPS} groups"
    factor = band_factor(np.concatenate(ratios)[asked], predicted_groups)
    if not np.isfinite(factor).all():
        return None, "too many rollouts over left-out runs are not finite"
    return Band(factor, train.dt, COVERAGE, len(set(predicted_groups)), history, of_samples), ""


def _predict(model: Any, fold: FoldData) -> np.ndarray:
    """Predict on copies of the data that the model may see: writing into them, or reading beyond their views, never
    reaches the truth."""
    history = None if fold.history is None else (fold.history[0].copy(), fold.history[1].copy())
    S = np.array(predicted(model, fold.s0.copy(), fold.U.copy(), history, fold.context), dtype=float)
    expected = (*fold.U.shape[:2], fold.s0.shape[1])
    if S.shape != expected:
        raise ValueError(f"the prediction has shape {S.shape}; accepted: {expected} (batch, K, 10), without s0")
    return S


def _kept(model: Any) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Files of the saved model and its equations, and a note where a foreign model fails to save or to describe
    itself."""
    files: dict[str, bytes] = {}
    notes: dict[str, Any] = {}
    if callable(getattr(model, "save", None)):
        try:
            with tempfile.TemporaryDirectory(prefix="shipbench-") as folder:
                model.save(Path(folder, "model"))
                own = (
                    p for p in sorted(Path(folder).rglob("*")) if p.is_file() and not p.is_symlink()
                )  # a link may lead anywhere
                files = {p.relative_to(folder).as_posix(): p.read_bytes() for p in own}
        except _RAISED as error:  # its predictions are good all the same
            notes["save_failed"] = one_line(error)
    if callable(getattr(model, "describe", None)):
        try:
            text = model.describe()
        except _RAISED as error:
            notes["describe_failed"] = one_line(error)
        else:
            if text:
                files[EQUATIONS] = (str(text).rstrip() + "\n").encode()
    return files, notes
