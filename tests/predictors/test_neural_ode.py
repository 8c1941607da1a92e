from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from shipbench.errors import InputError
from shipbench.physics.wind import apparent_wind
from shipbench.predictors import neural_ode
from shipbench.predictors.base import make_predictor
from shipbench.predictors.calibrated import Calibrated
from shipbench.predictors.networks.residual import Drive, Grid, Residual, features, solve, typical_accelerations
from shipbench.predictors.networks.stacked import Scaler, generators
from shipbench.predictors.neural_ode import NeuralODE
from shipbench.predictors.physics import Physics
from shipbench.signals import MOTION, VELOCITY
from shipbench.specs import EffectSpec


@pytest.fixture(scope="module")
def parts(harbour):
    return harbour.subset(range(12)), harbour.subset(range(12, 14)), harbour.subset(range(14, 16))


@pytest.fixture(scope="module", autouse=True)
def weak_resistance():
    """Every fitted physics loses half of its resistance, so that there is something to learn on so few runs."""
    fit = Physics.fit

    def spoiled(self, train, valid=None, *, seed=0):
        fit(self, train, valid, seed=seed)
        self.p = self.p * np.where(np.isin(np.arange(11), (1, 2, 3)), 0.5, 1.0)
        return self

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Physics, "fit", spoiled)
        patch.setattr(neural_ode._Windows, "MINIBATCHES", 6)  # enough for twelve runs of 40 s
        yield


@pytest.fixture(scope="module")
def physics(parts, weak_resistance):
    return Physics().fit(parts[0], parts[1])


@pytest.fixture(scope="module")
def model(parts, weak_resistance):
    return NeuralODE(epochs=6, hidden=16).fit(parts[0], parts[1], seed=0)


def position_error(model, data):
    batch = data.batch()
    return np.hypot(*(model.predict(batch.s0, batch.U) - batch.truth)[..., :2].transpose(2, 0, 1)).mean()


@pytest.mark.long
def test_with_a_zero_residual_it_is_the_physics(parts, physics, model):
    batch = parts[2].batch()
    plain = NeuralODE(hidden=16)
    weights = {k: np.zeros_like(v) if "layers.2" in k else v for k, v in model._weights.items()}
    plain.physics, plain._weights, plain.improved = physics, weights, True
    np.testing.assert_allclose(
        plain.predict(batch.s0, batch.U), physics.predict(batch.s0, batch.U), rtol=1e-9, atol=1e-9
    )


def test_training_halves_the_error_of_the_physics(parts, physics, model):
    assert model.improved
    unseen = parts[1].merged(parts[2])  # validation chose among the epochs, nothing was fitted to it
    assert position_error(model, unseen) < 0.5 * position_error(physics, unseen)


def test_where_validation_does_not_improve_the_physics_itself_is_kept(parts, physics):
    useless = NeuralODE(epochs=1, lr=30.0, penalty=0.0).fit(parts[0], parts[1], seed=0)
    batch = parts[2].batch()
    assert not useless.improved
    np.testing.assert_array_equal(useless.predict(batch.s0, batch.U), useless.physics.predict(batch.s0, batch.U))
    np.testing.assert_allclose(useless.physics.p, physics.p)


@pytest.fixture(scope="module")
def hybrid(parts, weak_resistance):
    return NeuralODE(base="calibrated", epochs=2, hidden=8).fit(parts[0], parts[1], seed=0)


@pytest.mark.parametrize("base", ["physics", "calibrated"])
def test_the_training_solver_agrees_with_the_rollout(parts, physics, hybrid, base):
    train, physics = parts[0], {"physics": physics, "calibrated": hybrid.physics}[base]
    grid = Grid.of(physics)
    drive = Drive.of([physics], [train], grid)
    residual = Residual(
        [physics], 8, Scaler.fit([features(drive.S, None)]), typical_accelerations([physics], drive), generators([0])
    )
    with torch.no_grad():
        found = solve(residual, drive.S[None, :, 0], drive.path[None], None, grid.step)[0].numpy()
    batch = train.batch()
    truth = physics.predict(batch.s0, batch.U)[..., VELOCITY]
    assert np.abs(found - truth).max(axis=(0, 1)) == pytest.approx(np.zeros(3), abs=2e-3)


@pytest.fixture(scope="module")
def windy(parts):
    """The same runs with a measured wind that does nothing: the physics' wind force is wrong by all of it."""
    rng = np.random.default_rng(0)

    def blown(run):
        wind = np.tile([rng.uniform(6.0, 12.0), rng.uniform(0.0, 2.0 * np.pi)], (len(run), 1))
        return replace(
            run, inputs=np.hstack([run.inputs, wind]), inputs_names=(*run.inputs_names, "wind_speed", "wind_from")
        )

    return [part.with_runs([blown(run) for run in part.runs]) for part in parts]


def test_the_residual_sees_the_measured_wind(windy):
    physics = Physics().fit(windy[0], windy[1])
    drive = Drive.of([physics], [windy[0]], Grid.of(physics))
    seen = features(drive.S[:, :-1], drive.air)
    run = windy[0].runs[3]
    expected = apparent_wind(run.states[:-1, 2], run.states[:-1, 3], run.states[:-1, 4], *run.inputs[:-1, 4:].T)
    np.testing.assert_allclose(seen[3, :, 7:].numpy(), np.stack(expected, axis=1), atol=1e-4)


@pytest.mark.long
def test_a_wrong_wind_force_is_learned_and_the_solvers_agree_on_it(windy, tmp_path, monkeypatch):
    monkeypatch.setattr(neural_ode._Windows, "MINIBATCHES", 20)
    model = NeuralODE(epochs=6, hidden=16).fit(windy[0], windy[1], seed=0)
    assert model.improved
    unseen = windy[1].merged(windy[2])
    assert position_error(model, unseen) < 0.6 * position_error(model.physics, unseen)
    batch, grid = unseen.batch(), Grid.of(model.physics)
    drive = Drive.of([model.physics], [unseen], grid)
    with torch.no_grad():
        found = solve(model._residual().float(), drive.S[None, :, 0], drive.path[None], drive.air[None], grid.step)[
            0
        ].numpy()
    assert np.abs(found - model.predict(batch.s0, batch.U)[..., VELOCITY]).max(axis=(0, 1)) == pytest.approx(
        np.zeros(3), abs=5e-3
    )
    model.save(tmp_path / "m")
    np.testing.assert_array_equal(
        NeuralODE.load(tmp_path / "m").predict(batch.s0, batch.U), model.predict(batch.s0, batch.U)
    )


@pytest.mark.long
def test_effects_of_the_physics_act_in_training_and_in_rollouts(parts, tmp_path):
    train, valid, test = parts
    effects = [EffectSpec("current", {}), EffectSpec("race_gain", {}), EffectSpec("rudder_lag", {})]
    group = [NeuralODE(epochs=2, hidden=8).extend(effects) for _ in range(2)]
    NeuralODE.fit_group(group, [train, train.subset(range(9))], [valid, None], [0, 1])
    batch = test.batch()
    for m, model in enumerate(group):
        physics = (
            Physics()
            .extend(effects)
            .fit(train if m == 0 else train.subset(range(9)), valid if m == 0 else None, seed=m)
        )
        drive, grid = Drive.of([model.physics], [test], Grid.of(model.physics)), Grid.of(model.physics)
        model.improved = True  # also where validation kept the physics: the network is in the way, and adds nothing
        with torch.no_grad():
            found = solve(model._residual().float(), drive.S[None, :, 0], drive.path[None], None, grid.step)[0].numpy()
        assert np.abs(found - model.predict(batch.s0, batch.U)[..., VELOCITY]).max(axis=(0, 1)) == pytest.approx(
            np.zeros(3), abs=5e-3
        )
        model._weights = {k: np.zeros_like(v) if "layers.2" in k else v for k, v in model._weights.items()}
        if m == 0:  # the other physics lost its validation runs to the split
            np.testing.assert_allclose(
                model.predict(batch.s0, batch.U), physics.predict(batch.s0, batch.U), rtol=1e-5, atol=1e-4
            )
        model.save(tmp_path / f"m{m}")
        again = NeuralODE.load(tmp_path / f"m{m}")
        assert again.effects == tuple(effects)
        np.testing.assert_array_equal(again.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U))


@pytest.mark.parametrize("name", ["heading_bias", "bank_suction", "no_such"])
def test_effects_that_it_cannot_train_with_are_refused(name):
    with pytest.raises(InputError, match=name):
        NeuralODE().extend([EffectSpec(name, {})])


@pytest.mark.long
def test_members_of_a_group_come_out_as_they_would_alone(parts, model):
    train, valid, test = parts
    batch = test.batch()
    group = [NeuralODE(epochs=6, hidden=16), NeuralODE(epochs=6, hidden=16)]
    NeuralODE.fit_group(group, [train, train.subset(range(9))], [valid, None], [0, 1])
    assert group[0].improved
    assert group[1].improved
    np.testing.assert_allclose(
        group[0].predict(batch.s0, batch.U)[..., MOTION],
        model.predict(batch.s0, batch.U)[..., MOTION],
        rtol=1e-3,
        atol=1e-2,
    )


def test_a_saved_model_keeps_its_physics(parts, model, tmp_path):
    batch = parts[2].batch()
    model.save(tmp_path / "m")
    loaded = NeuralODE.load(tmp_path / "m")
    np.testing.assert_array_equal(loaded.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U))
    np.testing.assert_array_equal(loaded.physics.p, model.physics.p)


def test_a_calibrated_base_is_the_predictor_calibrated_on_the_same_runs(parts, hybrid):
    batch, base = parts[2].batch(), Calibrated().fit(parts[0], parts[1], seed=0)
    np.testing.assert_allclose(hybrid.physics.calibration.base, base.calibration.base, rtol=1e-6, atol=1e-8)
    zero = NeuralODE(base="calibrated", hidden=8)
    weights = {k: np.zeros_like(v) if "layers.2" in k else v for k, v in hybrid._weights.items()}
    zero.physics, zero._weights, zero.improved = hybrid.physics, weights, True
    expected = base.predict(batch.s0, batch.U)
    np.testing.assert_allclose(zero.predict(batch.s0, batch.U), expected, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize(("gains", "pays"), [([0.1, 0.1], True), ([0.4, -0.2], False), ([0.1], True), ([-0.1], False)])
def test_a_gain_has_to_exceed_its_standard_error_over_validation_runs(monkeypatch, gains, pays):
    task = object.__new__(neural_ode._Windows)
    torch.nn.Module.__init__(task)
    task.validation, task.first = Drive(None, None, None, (len(gains),)), torch.ones(1, len(gains))
    monkeypatch.setattr(task, "_validated", lambda: (None, None, None))
    monkeypatch.setattr(neural_ode, "position_errors", lambda *_: 1.0 - torch.tensor([gains]))
    assert task.pays(1.0) == [pays]


def test_machine_code_of_a_calibrated_base_has_the_gradients_of_its_formula(parts, hybrid):
    """Without a compiler, or on a GPU, torch differentiates the formula."""
    drive = Drive.of([hybrid.physics], [parts[0]], Grid.of(hybrid.physics))
    residual = hybrid._residual()
    start, path, code = drive.S[None, :, 0].double(), drive.path[None, :, :10].double(), residual.code
    found = []
    for residual.code in (code, None):
        first = start.clone().requires_grad_()
        end = solve(residual, first, path, None, 1.0)
        found.append((end.detach(), *torch.autograd.grad((end * torch.arange(1.0, 4.0)).sum(), first)))
    for compiled, formula in zip(*found, strict=True):
        torch.testing.assert_close(compiled, formula, rtol=1e-6, atol=1e-9)


def test_on_validation_runs_no_residual_is_worse_than_its_calibrated_base(parts, hybrid):
    assert position_error(hybrid, parts[1]) <= position_error(hybrid.physics, parts[1]) + 1e-3  # errors of the solvers
    useless = NeuralODE(base="calibrated", hidden=8, epochs=1, lr=30.0, penalty=0.0).fit(parts[0], parts[1], seed=0)
    assert not useless.improved
    assert position_error(useless, parts[2]) == position_error(useless.physics, parts[2])


def test_a_saved_model_keeps_its_calibrated_base(parts, hybrid, tmp_path):
    batch = parts[2].batch()
    hybrid.save(tmp_path / "m")
    loaded = NeuralODE.load(tmp_path / "m")
    assert isinstance(loaded.physics, Calibrated)
    np.testing.assert_array_equal(loaded.predict(batch.s0, batch.U), hybrid.predict(batch.s0, batch.U))


@pytest.mark.long
def test_effects_of_a_calibrated_base_act_in_training_and_in_rollouts(windy, tmp_path):
    """Two members with a current and a measured wind: each keeps its own coefficients."""
    train, valid, test = windy
    effects = [EffectSpec("current", {}), EffectSpec("rudder_lag", {})]
    group = [NeuralODE(base="calibrated", epochs=2, hidden=8).extend(effects) for _ in range(2)]
    NeuralODE.fit_group(group, [train, train.subset(range(9))], [valid, valid], [0, 1])
    batch, bases = test.batch(), [model.physics for model in group]
    drive = Drive.of(bases, [test, test], Grid.of(bases[0]))
    together = Residual(bases, 8, Scaler.fit([features(drive.S[:, :-1], drive.air)] * 2),
                        typical_accelerations(bases, drive), generators([0, 1]))  # fmt: skip
    runs = torch.arange(len(drive.S)).view(2, -1)
    with torch.no_grad():
        found = solve(together, drive.S[runs][:, :, 0], drive.path[runs], drive.air[runs], Grid.of(bases[0]).step)
    for velocity, base in zip(found.numpy(), bases, strict=True):
        truth = base.predict(batch.s0, batch.U)[..., VELOCITY]
        assert np.abs(velocity - truth).max(axis=(0, 1)) == pytest.approx(np.zeros(3), abs=5e-3)
    group[0].save(tmp_path / "m")
    assert NeuralODE.load(tmp_path / "m").effects == tuple(effects)


def test_what_a_base_cannot_be_is_refused(parts, monkeypatch):
    with pytest.raises(InputError, match=r"base = 'mmg'; accepted: physics, calibrated"):
        make_predictor("neural_ode[base=mmg]")
    with pytest.raises(InputError, match="fits the hull's coefficients already"):
        make_predictor("neural_ode[base=calibrated]+hull_derivatives")
    with pytest.raises(InputError, match=r"calibrated\+heading_bias"):
        make_predictor("neural_ode[base=calibrated]+heading_bias")

    def shallow(self, train, valid=None, *, seed=0):
        self.shallow = True
        return self

    monkeypatch.setattr(Calibrated, "fit", shallow)
    with pytest.raises(InputError, match="water depth"):
        NeuralODE(base="calibrated").fit(parts[0], parts[1])


def test_coarse_and_fine_samples_get_steps_that_fit_the_ship(physics):
    assert Grid.of(physics) == (1, 1, 1.0)
    physics_fine = Physics()
    physics_fine._set_ship(physics.ship, physics.inputs, 0.1, False)
    assert Grid.of(physics_fine) == (11, 1, pytest.approx(1.1))
    physics_coarse = Physics()
    physics_coarse._set_ship(physics.ship, physics.inputs, 4.0, False)
    assert Grid.of(physics_coarse) == (1, physics_coarse.substeps, 4.0 / physics_coarse.substeps)
    assert physics_coarse.substeps > 1


@pytest.mark.parametrize(("stride", "first", "middle"), [(1, 0.0, 0.5), (2, 0.0, 1.0), (3, 0.0, 1.5)])
def test_actuators_are_taken_at_the_beginning_and_the_middle_of_a_step(parts, physics, stride, first, middle):
    """The path of a shaft that is ramped by 1 rpm a second shows the time at which it is taken."""

    class Ramp(Physics):
        def actuator_path(self, s0, U):
            t = np.arange(U.shape[1])[:, None] + np.array([0.0, 0.5, 1.0])
            return np.broadcast_to(t[None, :, :, None], (len(s0), *t.shape, 4))

    ramp = Ramp()
    ramp._set_ship(physics.ship, physics.inputs, 1.0, False)
    drive = Drive.of([ramp], [parts[0]], Grid(stride, 1, float(stride)))
    np.testing.assert_allclose(drive.path[0, :2, :, 0], [[first, middle], [stride + first, stride + middle]])
    assert drive.S.shape[1] == 40 // stride + 1


def test_wrong_settings_and_use_before_fit_are_refused(parts):
    with pytest.raises(ValueError, match="hidden = 0"):
        NeuralODE(hidden=0)
    batch = parts[2].batch()
    with pytest.raises(InputError, match="before fit"):
        NeuralODE().predict(batch.s0, batch.U)
