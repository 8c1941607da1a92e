"""A user's `simulate(s0, U, dt)` as a model: batches and single runs, settings, context, wrong functions."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.api import benchmark
from shipbench.contract.check import check_model
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor
from shipbench.predictors.context import Context
from shipbench.predictors.own_simulator import Simulator

FILE = '''
import numpy as np

def whole(s0, U, dt, speed=1.0):
    """Straight on."""
    assert s0.ndim == 2
    t = dt * np.arange(1, U.shape[1] + 1)
    S = np.repeat(s0[:, None], len(t), axis=1)
    psi, u, v = s0[:, 2, None], speed * s0[:, 3, None], speed * s0[:, 4, None]
    S[..., 0] += t * (u * np.cos(psi) - v * np.sin(psi))
    S[..., 1] += t * (u * np.sin(psi) + v * np.cos(psi))
    return S

def one(s0, U, dt):
    x, y, psi, u, v = s0[:5]  # no batch
    return whole(s0[None], U[None], dt)[0]

def asks(s0, U, dt, *, context):
    assert len(context) == len(s0) and context.ship.L == 130.0 and context.dt == dt
    return whole(s0, U, dt)

class Mine:
    def __init__(self, speed=1.0):
        self.speed = speed
    def simulate(self, s0, U, dt):
        return whole(s0, U, dt, self.speed)

def two(a, b):
    return a

def short(s0, U, dt):
    return whole(s0, U, dt)[:, 1:]
'''


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "sim.py"
    path.write_text(FILE)
    return path


def predicted(spec: str, harbour) -> np.ndarray:
    batch = harbour.batch()
    model = make_predictor(spec).fit(harbour)
    return np.asarray(model.predict(batch.s0, batch.U, context=Context.of(harbour)))


@pytest.mark.parametrize("name", ["one", "asks", "Mine", "Mine[speed=1.0]", "whole[speed=1.0]"])
def test_every_form_gives_the_same(file, harbour, name):
    np.testing.assert_array_equal(predicted(f"{file}:{name}", harbour), predicted(f"{file}:whole", harbour))


def test_a_setting_reaches_the_function(file, harbour):
    assert not np.allclose(predicted(f"{file}:whole[speed=2.0]", harbour), predicted(f"{file}:whole", harbour))


@pytest.mark.parametrize(
    "name", ["asks", *(pytest.param(name, marks=pytest.mark.long) for name in ("whole", "one", "Mine"))]
)
def test_no_rule_of_the_contract_is_broken(file, name):
    assert not check_model(f"{file}:{name}").of("broken")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("two", "cannot be called as simulate"),
        ("Mine[sped=2.0]", r"'sped'. Its arguments: \(speed=1.0\)"),
        ("whole[pace=2]", "pace"),
        ("nothing", "Known: Mine, asks, one"),
    ],
)
def test_a_function_that_cannot_be_called_is_refused_with_its_arguments(file, name, said):
    with pytest.raises(InputError, match=said):
        make_predictor(f"{file}:{name}")


def test_another_shape_is_told_with_what_is_accepted(file, harbour):
    batch = harbour.batch()
    with pytest.raises(ValueError, match=r"returned the shape .*; accepted"):
        make_predictor(f"{file}:short").fit(harbour).predict(batch.s0, batch.U)


def test_the_context_is_missed_with_a_message(file, harbour):
    batch = harbour.batch()
    with pytest.raises(InputError, match="asks for the context"):
        make_predictor(f"{file}:asks").fit(harbour).predict(batch.s0, batch.U)


def test_a_function_in_memory_is_scored_under_its_name(harbour):
    def still(s0, U, dt):
        return np.repeat(s0[:, None], U.shape[1], axis=1)

    scores = benchmark([still, "hold"], harbour, horizon=20, folds=2, quiet=True)
    assert set(scores.table()["model"]) == {"still", "hold"}


def test_the_context_holds_run_and_time_of_each_window(harbour):
    windows = harbour.windows(10, history=3)
    context = Context.of(windows, history=3)
    assert context.runs[:2] == (harbour.runs[0].id,) * 2
    np.testing.assert_allclose(context.start[:3], [3.0, 13.0, 23.0])
    assert context.rows([2, 0]).start.tolist() == [23.0, 3.0]
    assert repr(Simulator(len_of)) == "<Simulator len_of>"


def len_of(s0, U, dt):
    return U


def keeping(kept: list[float], anew: bool):
    """Function of one run that keeps its rudder angle in `kept` from call to call, or begins anew."""

    def simulate(s0, U, dt):
        if anew:
            kept[0] = float(s0[7])
        elif not kept:
            kept.append(s0[7])
        x, y, psi, u, v, r = s0[:6]
        states = []
        for n, delta in U[:, :2]:
            kept[0] += 0.1 * (delta - kept[0])
            r += dt * 1e-3 * kept[0]
            psi += dt * r
            states.append([x, y, psi, u, v, r, n, kept[0], 0.0, 0.0])
        return np.array(states)

    return simulate


@pytest.mark.parametrize("kept", [[], [0.0]])
@pytest.mark.parametrize("runs", [1, 6, 9])
def test_a_function_that_keeps_its_state_between_calls_is_refused_and_one_that_begins_anew_is_not(harbour, runs, kept):
    batch = harbour.subset(range(runs)).batch()
    batch.U[:, :, 1] = 0.3
    with pytest.raises(ValueError, match=r"same run is asked again: .* Begin each call anew from s0"):
        Simulator(keeping([*kept], False)).fit(harbour).predict(batch.s0, batch.U)
    S = Simulator(keeping([0.0], True)).fit(harbour).predict(batch.s0, batch.U)
    assert np.isfinite(S).all()


def test_a_function_that_draws_is_refused(harbour):
    batch = harbour.batch()
    draws = np.random.default_rng(0)
    with pytest.raises(ValueError, match="draw random numbers from a seed"):
        Simulator(lambda s0, U, dt: np.repeat(s0[:, None], U.shape[1], 1) + draws.normal(size=10)).fit(harbour).predict(
            batch.s0, batch.U
        )


@pytest.mark.parametrize("single", [True, False])
def test_a_run_on_which_it_raises_has_no_states_and_the_others_do(harbour, caplog, single):
    batch = harbour.batch()
    bad = batch.s0[0, 0]

    def one(s0, U, dt):
        if s0[0] == bad:
            raise RuntimeError("no solution")
        return np.repeat(np.array(s0[:10].tolist())[None], len(U), axis=0)

    def whole(s0, U, dt):
        return np.stack([one(s, u, dt) for s, u in zip(s0, U, strict=True)])

    S = Simulator(one if single else whole).fit(harbour).predict(batch.s0, batch.U, context=Context.of(harbour))
    assert np.isnan(S[0]).all()
    assert np.isfinite(S[1:]).all()
    assert f"fails in 1 of {len(S)} runs, which have no states: {harbour.runs[0].id}: RuntimeError" in caplog.text


def test_a_function_that_raises_on_every_run_is_refused_with_its_message(harbour):
    batch = harbour.batch()

    def never(s0, U, dt):
        raise RuntimeError("no solution")

    with pytest.raises(ValueError, match=r"of never fails. RuntimeError: no solution. Accepted"):
        Simulator(never).fit(harbour).predict(batch.s0, batch.U)


@pytest.mark.parametrize(("axis", "calls"), [(-1, 4), (0, 9)])
def test_a_function_that_takes_both_is_asked_for_batches(harbour, axis, calls):
    batch = harbour.subset(range(6)).batch()
    asked = []

    def simulate(s0, U, dt):
        asked.append(s0.shape)
        s0[..., 0] += s0[3] if axis == 0 else s0[..., 3]  # s0[3] is a speed for one run alone
        return np.repeat(s0[..., None, :], U.shape[-2], axis=-2)

    model = Simulator(simulate).fit(harbour)
    S = model.predict(batch.s0, batch.U)
    np.testing.assert_allclose(S[:, 0, 0], batch.s0[:, 0] + batch.s0[:, 3])
    assert len(asked) == calls


def test_scores_of_a_function_that_knows_the_runs_say_so(harbour):
    def still(s0, U, dt):
        return np.repeat(s0[:, None], U.shape[1], axis=1)

    def notes(fingerprint: str) -> list[list[str]]:
        vars(still)["fitted_to"] = fingerprint
        scores = benchmark([still], harbour, horizon=20, folds=2, quiet=True)
        return [summary["simulation_notes"] for summary in scores.results.summaries]

    assert all("it was fitted to these runs" in note for [note] in notes(harbour.fingerprint))
    assert notes("of other runs") == [[], []]


def test_a_file_alone_is_answered_with_its_functions(file):
    with pytest.raises(InputError, match=rf"names a file without its class or function. Give {file}:whole or .*:Mine"):
        make_predictor(str(file))
