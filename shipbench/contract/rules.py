"""Contract of a predictor, rule by rule (contract, section 2). Every rule stands here once: `shipbench check` and the
tests of the built-in models both use `RULES`."""

from __future__ import annotations

from dataclasses import asdict, is_dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..predictors.base import make_predictor
from ..predictors.context import Context, predicted
from ..signals import PSI, STATES, move_frame, wrap_angle
from .base import Rule
from .saving import same_after_loading
from .small import what_changed
from .subject import HISTORY, Broken, NotApplicable, Subject, attempt, raised

ROUNDING = 1e-4
"""Rounding tolerance relative to a state's size: the loss of a model in single precision when the same is computed in
another order."""
_LEAK = 1e-6


def _unfitted(c: Subject) -> None:
    """Raise `NotApplicable` for a rule of `fit` on a saved model."""
    if c.saved:
        raise NotApplicable("a saved model comes fitted")


def _from_start(c: Subject) -> None:
    """Raise `NotApplicable` for a rule on other starts where the states are read from a file."""
    if c.replay:
        raise NotApplicable(c.replay)


def fit(c: Subject) -> str:
    """`fit(train, valid, seed=...)` learns from the training runs; `valid` only decides when to stop."""
    _unfitted(c)
    return f"{len(c.parts[0])} runs, {len(c.parts[1])} validation runs: {c.fitted.seconds:.2f} s"


def parameters(c: Subject) -> str:
    """The spec's values reach the model, before and after `fit`; a misspelled one is refused."""
    if c.saved:
        raise NotApplicable("a saved model takes no parameters")
    if c.spec.given is not None:
        raise NotApplicable("a class or object in memory takes no parameters from a spec")
    given = {k: v for k, v in c.spec.params.items() if k != "seed"}
    held, said = given, []
    for model, when in ((make_predictor(c.spec), "when it is made"), (c.model, "after fit")):
        held = given | _flat(model)
        for key, value in given.items():
            if held[key] != value:
                raise Broken(f"{key} = {value} in the spec, {key} = {held[key]} {when}")
    if given:
        said.append(", ".join(f"{k} = {v}" for k, v in given.items()) + " kept")
    try:
        make_predictor(replace(c.spec, params={**c.spec.params, "no_such_parameter": 1}))
    except InputError:
        return "; ".join([*said, "an unknown parameter is refused"])
    raise Broken(
        "[no_such_parameter=1] is accepted: a misspelled parameter would be ignored in silence. Refuse unknown ones "
        "(no **kwargs)"
    )


def _flat(model: Any) -> dict[str, Any]:
    """Public attributes, with dataclass fields that are dicts spread out."""
    found = (
        asdict(model)
        if is_dataclass(model) and not isinstance(model, type)
        else {k: v for k, v in vars(model).items() if not k.startswith("_")}
    )
    inner = [value for value in found.values() if isinstance(value, dict)]
    return {**found, **{k: v for d in inner for k, v in d.items()}}


def fit_returns(c: Subject) -> str:
    """`fit` returns the model, so that `make_predictor(...).fit(train)` can be used at once."""
    _unfitted(c)
    if c.fitted.returned is not c.model:
        raise Broken(f"fit returned {type(c.fitted.returned).__name__}; end it with `return self`")
    return "the model itself"


def valid_optional(c: Subject) -> str:
    """`fit(train, seed=...)` works without validation runs."""
    _unfitted(c)
    return f"{len(c.few)} runs: {c.fit(state=1, train=c.few).seconds:.2f} s"


def fit_inputs(c: Subject) -> str:
    """`fit` leaves the data as they are: other models are fitted on them too."""
    _unfitted(c)
    for name, before, after in (("train", c.parts[0], c.fitted.train), ("valid", c.parts[1], c.fitted.valid)):
        if changed := what_changed(before, after):  # type: ignore[arg-type]
            raise Broken(f"fit changed {changed} of `{name}`; work on a copy")
    return f"{len(c.parts[0]) + len(c.parts[1])} runs unchanged"


def history(c: Subject) -> str:
    """`predict(s0, U)` works without a history, and with one it has the same shape."""
    batch = c.parts[2].batch(history=HISTORY)
    plain = attempt(lambda: c.ask(batch.s0, batch.U))
    told = attempt(lambda: c.ask(batch.s0, batch.U, batch.history))
    if isinstance(plain, Exception):
        if isinstance(told, Exception):
            raise NotApplicable("predict fails with and without a history: see the rule 'shape'")
        raise Broken(f"without a history it {raised(plain)}; accept history=None")
    if isinstance(told, Exception):
        raise Broken(
            f"with a history of {HISTORY} samples it {raised(told)}; predict(s0, U, history=None) must take the "
            "third argument"
        )
    if told.shape != plain.shape:
        raise Broken(f"shape {told.shape} with a history of {HISTORY} samples, {plain.shape} without")
    return f"shape {plain.shape} with {HISTORY} samples and without"


def shape(c: Subject) -> str:
    """`predict` gives states (batch, K, 10) for any batch and any K, finite one step ahead and, in some run at least,
    to the end."""
    batch, K = c.batch, c.batch.U.shape[1]
    shapes = []
    for runs, steps in ((len(batch.s0), K), (1, K), (len(batch.s0), K // 3), (len(batch.s0), 1)):
        S = attempt(lambda n=runs, k=steps: c.ask(batch.s0[:n], batch.U[:n, :k], rows=slice(n)))  # type: ignore[misc]
        if isinstance(S, Exception):
            raise Broken(f"for {runs} runs and {steps} steps it {raised(S)}")
        if S.shape != (runs, steps, len(STATES)):
            raise Broken(
                f"shape {S.shape} for {runs} runs and {steps} steps; accepted: {(runs, steps, len(STATES))}, s0 not "
                "among them"
            )
        shapes.append(str(S.shape))
    finite = np.isfinite(c.S).all(axis=2)
    if not finite[:, 0].all() or not finite.all(axis=1).any():
        i, k = (int(n) for n in np.argwhere(~finite)[0])
        j = int(np.argmin(np.isfinite(c.S[i, k])))
        hint = "; a saved model may need data of its own ship: --dataset" if c.saved else ""
        raise Broken(f"{STATES[j]} is {c.S[i, k, j]} at step {k + 1} of run {i}, on ordinary data{hint}")
    gone = int((~finite.all(axis=1)).sum())
    return ", ".join(shapes) + (
        f"; {gone} of {len(finite)} runs diverge, which is a result and breaks no rule" if gone else ""
    )


def dtype(c: Subject) -> str:
    """`predict` gives a numpy array of floats, and takes float32 as well."""
    batch = c.batch
    S = predicted(c.model, batch.s0.copy(), batch.U.copy(), None, Context.of(c.parts[2]))
    if not isinstance(S, np.ndarray) or not np.issubdtype(S.dtype, np.floating):
        kind = f"an array of {S.dtype}" if isinstance(S, np.ndarray) else f"a {type(S).__module__}.{type(S).__name__}"
        raise Broken(f"predict returned {kind}; accepted: a numpy array of float64 or float32")
    single = attempt(lambda: c.ask(batch.s0.astype(np.float32), batch.U.astype(np.float32)))
    if isinstance(single, Exception):
        raise Broken(f"for float32 arguments it {raised(single)}")
    if single.shape != S.shape:
        raise Broken(f"shape {single.shape} for float32 arguments, {S.shape} for float64")
    return f"{S.dtype}; float32 arguments are taken"


def start(c: Subject) -> str:
    """S[:, 0] is the state at t_1: s0 is not in S."""
    given = np.array_equal(c.S[:, 0], c.batch.s0)
    if given and not np.array_equal(c.S[:, 1], c.S[:, 0]):
        raise Broken("S[:, 0] is s0 itself and S[:, 1] differs from it: every state comes one step late. Leave s0 out")
    away = np.hypot(*(c.S[:, 0, :2] - c.batch.s0[:, :2]).T)
    return f"S[:, 0] lies {away.min():.3g} to {away.max():.3g} m from s0"


def repeatable(c: Subject) -> str:
    """`predict` changes nothing in the model and draws nothing: called again, after another call, it returns the
    same."""
    batch = c.batch
    first = c.S
    c.ask(batch.s0[::-1] * 1.1, batch.U[::-1], rows=slice(None, None, -1))
    return c.same(c.ask(batch.s0, batch.U), first, 0.0, "asked again after another question")


def predict_inputs(c: Subject) -> str:
    """`predict` leaves s0, U and the history as they are."""
    batch = c.parts[2].batch(history=HISTORY)
    past = batch.history[0].copy(), batch.history[1].copy()  # type: ignore[index]
    given = {
        "s0": batch.s0.copy(),
        "U": batch.U.copy(),
        "the history's states": past[0],
        "the history's inputs": past[1],
    }
    before = {name: array.copy() for name, array in given.items()}
    predicted(c.model, given["s0"], given["U"], past, Context.of(c.parts[2], HISTORY))
    for name, array in given.items():
        if not np.array_equal(array, before[name]):
            raise Broken(f"predict wrote into {name} ({int((array != before[name]).sum())} values); work on a copy")
    return "s0, U and history unchanged"


def single_run(c: Subject) -> str:
    """A single run without the batch axis, s0 (10,) and U (K, inputs), gives (K, 10)."""
    alone = attempt(lambda: c.ask(c.batch.s0[0], c.batch.U[0], rows=slice(1)))
    if isinstance(alone, Exception):
        raise Broken(f"for s0 (10,) and U {c.batch.U[0].shape} it {raised(alone)}")
    together = c.ask(c.batch.s0[:1], c.batch.U[:1], rows=slice(1))[0]
    return c.same(alone, together, ROUNDING, "difference to the same run as a batch of one")


def batch_independence(c: Subject) -> str:
    """The prediction for a run depends neither on the runs beside it nor on their order."""
    batch = c.batch
    each, back = [slice(i, i + 1) for i in range(len(batch.s0))], slice(None, None, -1)
    loop = np.concatenate([c.ask(batch.s0[one], batch.U[one], rows=one) for one in each])
    reverse = c.ask(batch.s0[back], batch.U[back], rows=back)[back]
    said = c.same(loop, c.S, ROUNDING, "run by run")
    return f"{said}; {c.same(reverse, c.S, ROUNDING, 'in reverse order')}"


def causality(c: Subject) -> str:
    """Later inputs do not move earlier states."""
    batch, k = c.batch, c.batch.U.shape[1] // 2
    spread = np.ptp(batch.U, axis=(0, 1))
    other = batch.U.copy()
    other[:, k:] = other[::-1, k:] + np.where(spread > 0.0, spread, 1.0)
    said = c.same(
        c.ask(batch.s0, other)[:, :k], c.S[:, :k], _LEAK, f"other inputs from step {k + 1} on, states up to step {k}"
    )
    shorter = c.same(c.ask(batch.s0, batch.U[:, :k]), c.S[:, :k], ROUNDING, f"K = {k} in place of {batch.U.shape[1]}")
    return f"{said}; {shorter}"


def heading(c: Subject) -> str:
    """The heading is not wrapped: started one turn further (psi + 2 pi), it stays one turn further and nothing else
    changes."""
    _from_start(c)
    turn = np.eye(len(STATES))[PSI] * 2.0 * np.pi
    return c.same(c.ask(c.batch.s0 + turn, c.batch.U), c.S + turn, ROUNDING, "psi + 2 pi")


def translation(c: Subject) -> str:
    """A shifted origin shifts the prediction and changes nothing else."""
    _from_start(c)
    if c.earth_fixed:
        raise NotApplicable(c.earth_fixed)
    origin = np.array([500.0, -300.0])
    moved = c.ask(move_frame(c.batch.s0, origin, 0.0), c.batch.U)
    return c.same(moved, move_frame(c.S, origin, 0.0), ROUNDING, "origin shifted by (500, -300) m")


def rotation(c: Subject) -> str:
    """A ship started on another course from the same place sails the same track, turned."""
    _from_start(c)
    if "wind_from" in c.data.inputs:
        raise NotApplicable("the data have an earth-fixed input (wind_from)")
    if c.earth_fixed:
        raise NotApplicable(c.earth_fixed)
    turn, s0 = 1.2, c.batch.s0
    place = s0[:, :2].T
    back = (
        place - move_frame(s0, np.zeros(2), turn)[:, :2].T
    )  # turned about each run's own start: its place is the rule 'translation'
    moved, expected = c.ask(move_frame(s0, back, turn), c.batch.U), move_frame(c.S, back[..., None], turn)
    moved[..., PSI] = expected[..., PSI] + wrap_angle(
        moved[..., PSI] - expected[..., PSI]
    )  # whole turns are the rule 'heading'
    return c.same(moved, expected, ROUNDING, f"turned by {turn} rad")


def seed(c: Subject) -> str:
    """The same data and seed give the same model, whatever the global random generators are at."""
    _unfitted(c)
    again = c.fit(state=2).model
    return c.same(c.ask(c.batch.s0, c.batch.U, model=again), c.S, ROUNDING, "fitted again with the same seed")


def diverging(c: Subject) -> str:
    """A run that goes astray becomes large or NaN: nothing is raised, and the other runs go on."""
    batch = c.batch
    said = []
    for factor in (1e3, 1e9):
        s0, U = batch.s0.copy(), batch.U.copy()
        s0[0, 3:] *= factor
        U[0] *= factor
        S = attempt(lambda s=s0, u=U: c.ask(s, u))  # type: ignore[misc]
        if isinstance(S, Exception):
            raise Broken(f"started with {factor:g} times the speeds, it {raised(S)}; return inf or NaN instead")
        if S.shape != c.S.shape:
            raise Broken(
                f"started with {factor:g} times the speeds, it returned the shape {S.shape}; accepted: {c.S.shape}"
            )
        c.same(S[1:], c.S[1:], ROUNDING, f"the other runs beside one with {factor:g} times the speeds")
        said.append(f"{factor:g} times the speeds: {'finite' if np.isfinite(S[0]).all() else 'inf or NaN'}")
    return "; ".join(said)


def not_finite(c: Subject) -> str:
    """NaN or inf in the arguments is refused with a ValueError or InputError, or stays in its own run and shows
    there."""
    _from_start(c)
    batch, k = c.batch, c.batch.U.shape[1] // 2
    said = []
    for what, value in (("s0 NaN", np.nan), ("s0 inf", np.inf), (f"U NaN at step {k + 1}", np.nan)):
        s0, U = batch.s0.copy(), batch.U.copy()
        if what.startswith("s0"):
            s0[0] = value
        else:
            U[0, k] = value
        S = attempt(lambda s=s0, u=U: c.ask(s, u))  # type: ignore[misc]
        if isinstance(S, ValueError | InputError):
            said.append(f"{what}: refused")
            continue
        if isinstance(S, Exception):
            raise Broken(f"{what}: {raised(S)}; raise a ValueError that says so, or return NaN")
        if what == "s0 NaN" and np.isfinite(S[0]).all():
            raise Broken(f"{what}: the prediction is finite all the same, as if the start were known")
        c.same(S[1:], c.S[1:], ROUNDING, f"{what} in one run, the other runs")
        said.append(f"{what}: {'finite' if np.isfinite(S[0]).all() else 'NaN'} in that run alone")
    return "; ".join(said)


_ASKED = ("fit", "history", "shape")
_COMPARED = (*_ASKED, "repeatable")
_FUNCTIONS = (
    ("fit", fit, ()), ("parameters", parameters, ("fit",)), ("fit_returns", fit_returns, ("fit",)),
    ("valid_optional", valid_optional, ("fit",)),
    ("fit_inputs", fit_inputs, ("fit",)), ("history", history, ("fit",)),
    ("shape", shape, ("fit", "history")), ("dtype", dtype, _ASKED), ("start", start, _ASKED),
    ("repeatable", repeatable, _ASKED),
    ("predict_inputs", predict_inputs, _ASKED), ("single_run", single_run, _COMPARED),
    ("batch", batch_independence, _COMPARED),
    ("causality", causality, _COMPARED), ("heading", heading, _COMPARED), ("translation", translation, _COMPARED),
    ("rotation", rotation, _COMPARED),
    ("seed", seed, _COMPARED), ("diverging", diverging, (*_COMPARED, "batch")),
    ("not_finite", not_finite, (*_COMPARED, "batch", "diverging")),
    ("saved", same_after_loading, _COMPARED),
)  # fmt: skip
RULES = tuple(
    Rule(name, " ".join((function.__doc__ or "").split()), function, after) for name, function, after in _FUNCTIONS
)
