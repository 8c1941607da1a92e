from __future__ import annotations

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.predictors.mlp import MLP
from shipbench.signals import PSI, R, U, move_frame


@pytest.fixture(scope="module")
def parts(harbour):
    return harbour.subset(range(12)), harbour.subset(range(12, 14)), harbour.subset(range(14, 16)).batch()


def quick(**more):
    return MLP(hidden=16, epochs=3, **more)


def test_the_defaults_are_the_papers():
    m = MLP()
    assert (m.hidden, m.layers, m.epochs, m.batch, m.lr, m.patience, m.min_delta, m.target) == (
        100,
        3,
        200,
        32,
        1e-3,
        10,
        1e-4,
        "state",
    )


def test_the_network_has_the_papers_layers(parts):
    model = MLP(epochs=1).fit(parts[0], parts[1], seed=0)
    shapes = [model._weights[f"net.layers.{i}.weight"].shape[1:] for i in range(4)]
    assert shapes == [(11, 100), (100, 100), (100, 100), (100, 7)]


@pytest.mark.parametrize("target", ["state", "increment"])
def test_members_of_a_group_come_out_as_they_would_alone(parts, target):
    train, valid, batch = parts
    other = train.subset(range(3, 12))  # fewer runs: its epochs end elsewhere
    group = [quick(target=target), quick(target=target), quick(target=target)]
    MLP.fit_group(group, [train, other, train], [valid, valid, None], [4, 5, 6])
    alone = [
        quick(target=target).fit(train, valid, seed=4),
        quick(target=target).fit(other, valid, seed=5),
        quick(target=target).fit(train, seed=6),
    ]
    for a, b in zip(group, alone, strict=True):
        np.testing.assert_allclose(
            a.predict(batch.s0, batch.U)[..., U:], b.predict(batch.s0, batch.U)[..., U:], rtol=1e-3, atol=1e-3
        )
    assert np.abs(group[0].predict(batch.s0, batch.U) - group[2].predict(batch.s0, batch.U)).max() > 1e-2, (
        "another seed is another model"
    )


def test_pose_follows_from_the_predicted_velocities_by_equation_10(parts):
    model, batch = quick().fit(parts[0], parts[1], seed=0), parts[2]
    S = model.predict(batch.s0, batch.U)
    psi = batch.s0[:, PSI] + S[:, 0, R]
    np.testing.assert_allclose(S[:, 0, PSI], psi)
    np.testing.assert_allclose(
        S[:, 1, 0], S[:, 0, 0] + S[:, 1, U] * np.cos(psi) - S[:, 1, U + 1] * np.sin(psi), rtol=1e-12, atol=1e-9
    )


def test_it_learns_the_next_state(parts):
    """One step ahead, the network beats the mean of the training data by far."""
    train, valid, batch = parts
    S = MLP(epochs=40).fit(train, valid, seed=0).predict(batch.s0, batch.U[:, :1])
    spread = np.stack([r.states for r in train.runs])[..., U:8].std((0, 1))
    error = np.sqrt(np.mean((S[:, 0, U:8] - batch.truth[:, 0, U:8]) ** 2, axis=0))
    assert (error < 0.5 * spread).all()


def test_scalers_come_from_the_training_runs_only(parts):
    train, valid, _ = parts
    a, b = quick().fit(train, valid, seed=0), quick().fit(train, train.subset([0]), seed=0)
    np.testing.assert_array_equal(a._weights["scale_x.mean"], b._weights["scale_x.mean"])
    y = np.stack([r.states for r in train.runs])[:, :-1, U:].reshape(-1, 7)
    np.testing.assert_allclose(a._weights["scale_x.mean"][0, 0, :7], y.mean(0), rtol=1e-4, atol=1e-6)


def test_turning_the_frame_turns_the_prediction_also_with_earth_fixed_wind(parts):
    from dataclasses import replace

    train, valid, batch = parts

    def windy(data):
        names = (*data.inputs, "wind_speed", "wind_from")
        runs = [
            replace(
                r, inputs=np.column_stack([r.inputs, np.full(len(r), 6.0), np.full(len(r), 1.0)]), inputs_names=names
            )
            for r in data.runs
        ]
        return data.with_runs(runs)

    model = quick().fit(windy(train), windy(valid), seed=0)
    wind = np.broadcast_to([6.0, 1.0], (*batch.U.shape[:2], 2))
    U0, U1 = np.concatenate([batch.U, wind], axis=2), np.concatenate([batch.U, np.add(wind, [0.0, 0.7])], axis=2)
    S = model.predict(batch.s0, U0)
    turned = model.predict(move_frame(batch.s0, np.array([5.0, 9.0]), 0.7), U1)
    np.testing.assert_allclose(turned, move_frame(S, np.array([5.0, 9.0]), 0.7), rtol=1e-6, atol=1e-6)
    assert np.abs(model.predict(batch.s0, U1) - S).max() > 1e-6, "the wind's direction is seen"


def test_wrong_settings_and_use_before_fit_are_refused(parts):
    with pytest.raises(ValueError, match="target = 'both'"):
        MLP(target="both")
    with pytest.raises(ValueError, match="hidden = 0"):
        MLP(hidden=0)
    with pytest.raises(InputError, match="before fit"):
        MLP().predict(parts[2].s0, parts[2].U)


def test_a_warm_start_goes_on_from_the_last_fit_in_its_scales(parts):
    train, valid, batch = parts
    first, other = train.subset(range(4)), train.subset(range(2, 12))
    alone = [quick().fit(first, valid, seed=1), quick().fit(other, valid, seed=2)]
    before = [model.predict(batch.s0, batch.U) for model in alone]
    scales = [model._weights["scale_x.mean"].copy() for model in alone]
    still = [MLP(hidden=16, epochs=1, lr=1e-12) for _ in alone]
    for model, fitted in zip(still, alone, strict=True):
        model._weights, model.warm_start = dict(fitted._weights), True
        model.fit(train, valid, seed=3)
    group = [quick().fit(first, valid, seed=1), quick().fit(other, valid, seed=2)]
    for model in (*alone, *group):
        model.warm_start = True
    MLP.fit_group(group, [train, other], [valid, valid], [3, 4])
    alone[0].fit(train, valid, seed=3)
    alone[1].fit(other, valid, seed=4)
    for m in range(2):
        np.testing.assert_allclose(still[m].predict(batch.s0, batch.U), before[m], rtol=1e-6, atol=1e-6)
        np.testing.assert_array_equal(group[m]._weights["scale_x.mean"], scales[m])
        np.testing.assert_allclose(
            group[m].predict(batch.s0, batch.U), alone[m].predict(batch.s0, batch.U), rtol=1e-3, atol=1e-2
        )
        assert not np.allclose(alone[m].predict(batch.s0, batch.U), before[m], atol=1e-2)
