"""Machine code made of a CasADi step: the same numbers as the interpreter, kept safely, and done without where it
cannot be made."""

from __future__ import annotations

import stat

import numpy as np
import pytest

from shipbench import kept_code
from shipbench.compiled import Lanes, Rollout, c_source

ca = pytest.importorskip("casadi")


def every_operation() -> ca.Function:
    x, w, p = ca.SX.sym("x", 3), ca.SX.sym("w", 2), ca.SX.sym("p", 2)
    a, b, c = ca.vertsplit(x)
    first = ca.sin(a) + ca.cos(b) * p[0] - ca.sqrt(c * c + 1.0) / (2.0 + ca.exp(-a * a)) + ca.tanh(w[0])
    first += ca.atan2(b, c) + ca.fmin(a, b) * ca.fmax(b, c)
    second = (
        ca.if_else(a < b, a * w[1], -b)
        + ca.sign(c) * ca.fabs(b)
        + ca.if_else(ca.logic_or(a <= c, ca.logic_not(b < 0)), 0.1, p[1])
        + 1.0 / c
    )
    third = ca.log(1.0 + a * a) + (1.5 + c * c) ** 0.7 + ca.if_else(ca.logic_and(a > 0, w[0] != w[1]), 2.0 * b, c)
    return ca.Function("step", [x, w, p], [ca.vertcat(first, ca.tanh(second), 0.1 * third)], {"cse": True})


@pytest.fixture
def compiler():
    if not kept_code.compiler()[0]:
        pytest.skip("no C compiler here")


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder; what is known of the compiler is asked again before and after."""
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    kept_code.compiler.cache_clear()
    yield tmp_path / "cache"
    monkeypatch.undo()
    kept_code.compiler.cache_clear()


def inputs(runs: int, samples: int = 7) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(runs)
    return rng.normal(size=(runs, 3)), rng.normal(size=(runs, samples, 2)), np.array([0.3, -1.2])


@pytest.mark.parametrize(("runs", "substeps"), [(1, 1), (8, 1), (11, 3)])
def test_machine_code_and_interpreter_agree(compiler, runs, substeps):
    step = every_operation()
    code, plain = Rollout(step), Rollout(step)
    plain._compiled = None
    assert code.compiled
    np.testing.assert_allclose(code(*inputs(runs), substeps), plain(*inputs(runs), substeps), rtol=1e-9, atol=1e-11)


def test_states_are_those_of_the_step_itself():
    step, (x0, w, p) = every_operation(), inputs(2)
    X = Rollout(step)(x0, w, p)
    for run in range(2):
        state = x0[run]
        for k in range(w.shape[1]):
            state = np.asarray(step(state, w[run, k], p)).ravel()
            np.testing.assert_allclose(X[run, k], state, rtol=1e-9, atol=1e-11)


def test_a_run_that_is_not_finite_disturbs_no_other(compiler):
    code, (x0, w, p) = Rollout(every_operation()), inputs(9)
    x0[3] = np.nan
    X = code(x0, w, p)
    others = np.arange(9) != 3
    assert np.isnan(X[3]).any(axis=1).all()
    np.testing.assert_array_equal(X[others], code(*inputs(9))[others])


def test_code_is_compiled_once_and_kept(compiler, fresh_cache):
    assert Rollout(every_operation()).compiled
    (kept,) = (fresh_cache / "compiled").iterdir()
    made = kept.stat().st_mtime_ns
    assert Rollout(every_operation()).compiled
    assert kept.stat().st_mtime_ns == made
    assert list((fresh_cache / "compiled").iterdir()) == [kept]


@pytest.mark.parametrize("command", ["none", "false", "no-such-compiler-here"])
def test_without_a_compiler_the_interpreter_does_the_work(fresh_cache, monkeypatch, command):
    monkeypatch.setenv("SHIPBENCH_COMPILER", command)
    rollout = Rollout(every_operation())
    assert not rollout.compiled
    assert np.isfinite(rollout(*inputs(2))).all()


def test_a_cache_folder_that_cannot_be_written_is_done_without(compiler, fresh_cache):
    fresh_cache.write_text("a file where the folder should be")
    assert Rollout(every_operation()).compiled
    assert stat.S_ISREG(fresh_cache.stat().st_mode)


def test_an_unknown_operation_is_left_to_the_interpreter():
    x, w, p = ca.SX.sym("x"), ca.SX.sym("w"), ca.SX.sym("p")
    step = ca.Function("step", [x, w, p], [ca.erf(x) + w * p])
    assert c_source(step) is None
    assert not Rollout(step).compiled


def test_wrong_shapes_are_refused_before_they_reach_machine_code():
    x0, w, p = inputs(2)
    for given in ((x0[:1], w, p), (x0[:, :2], w, p), (x0, w[..., :1], p), (x0, w, p[:1])):
        with pytest.raises(ValueError, match="accepted"):
            Rollout(every_operation())(*given)


@pytest.mark.parametrize("carried", [False, True])
def test_lanes_are_the_function_on_everything_spread_over_them(compiler, carried):
    """Directions in the values, samples and lanes in the inputs, two parts each; the last vector is not full."""
    step, rng = every_operation(), np.random.default_rng(0)
    D, K, B, S = 2, 4, 11, 2
    x, w, p = rng.normal(size=(K, B, 1, 3)), rng.normal(size=(K, B, S, 2)), rng.normal(size=(D, 1, 1, 1, 2))
    out = np.empty((D, K, B, 3))
    Lanes.of(step)([x, w, p], (D, K, B, S), out, carried)
    for d, b in ((0, 0), (1, 7), (1, 10)):
        state = x[0, b, 0]
        for k in range(K):
            state = state if carried else x[k, b, 0]
            for s in range(S):
                state = step(state, w[k, b, s], p[d, 0, 0, 0]).full().ravel()
            np.testing.assert_allclose(out[d, k, b], state, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("alone", [None, 0, 1, 2])
@pytest.mark.parametrize("turning", [0, 1, 2])
def test_what_is_shared_by_all_directions_is_computed_once_and_the_same(compiler, alone, turning):
    """Of a function that is no step, with one bundle that differs between directions: that of `alone`, or another."""
    step, rng, (D, K, B) = every_operation(), np.random.default_rng(1), (5, 3, 11)
    given = step.sx_in()
    two = ca.Function("two", given, [step(*given)[:2]], {"cse": True})
    x, w, p = (rng.normal(size=(D if i == turning else 1, K, B, 1, size)) for i, size in enumerate((3, 2, 2)))
    out = np.empty((D, K, B, 2))
    Lanes.of(two, alone)([x, w, p], (D, K, B, 1), out)
    for d, k, b in ((0, 0, 0), (4, 2, 10), (1, 1, 7), (3, 0, 8)):
        one = [a[d if i == turning else 0, k, b, 0] for i, a in enumerate((x, w, p))]
        np.testing.assert_allclose(out[d, k, b], two(*one).full().ravel(), rtol=1e-9, atol=1e-11)


def test_lanes_that_do_not_fit_are_refused(compiler):
    given = [np.zeros(3), np.zeros(2), np.zeros(2)]
    with pytest.raises(ValueError, match="accepted"):
        Lanes.of(every_operation())(given, (1, 2, 3, 1), np.empty((1, 2, 3, 2)))
    with pytest.raises(ValueError, match="broadcast"):
        Lanes.of(every_operation())([np.zeros((4, 1, 3)), *given[1:]], (1, 2, 3, 1), np.empty((1, 2, 3, 3)))
    x = ca.SX.sym("x")
    assert Lanes.of(ca.Function("erf", [x], [ca.erf(x)])) is None
