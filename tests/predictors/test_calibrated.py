"""The calibrated ship: better than the paper's physics beyond its runs, effects beside it, refinement, description."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.physics.mmg import load_mmg_ship
from shipbench.predictors.base import make_predictor
from shipbench.predictors.calibrated import Calibrated
from shipbench.records import Dataset, Run
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

SHIP = load_mmg_ship("container130")


@cache
def trials(seed: int, *hidden: tuple[str, tuple[float, ...]]) -> Dataset:
    causes = [Hidden(EFFECTS.get(name), q) for name, q in hidden]
    return sea_trials(SHIP, seed, causes, Trials(runs=8, samples=80))


@cache
def fitted(spec: str, seed: int, *hidden: tuple[str, tuple[float, ...]]) -> Calibrated:
    return make_predictor(spec).fit(trials(seed, *hidden))


def error(model: Calibrated, data: Dataset) -> float:
    batch = data.batch()
    return float(np.mean(np.linalg.norm((model.predict(batch.s0, batch.U) - batch.truth)[..., :2], axis=-1)))


def commanded(data: Dataset) -> Dataset:
    runs = (Run(r.id, r.t, np.concatenate([r.states[:, :6], r.inputs], axis=1), r.inputs) for r in data.runs)
    return replace(data, actuators="commanded", runs=tuple(runs))


def test_it_predicts_runs_that_were_not_fitted_better_than_the_papers_physics():
    unseen = trials(101)  # their gusts alone are worth 2 m
    assert error(fitted("calibrated", 1), unseen) < 0.8 * error(fitted("physics", 1), unseen)


def test_a_hidden_current_is_found_beside_all_coefficients():
    hidden = ("current", (0.3, -0.25))
    plain, model = fitted("calibrated", 1, hidden), fitted("calibrated+current", 1, hidden)
    np.testing.assert_allclose(model.extension.values[0], hidden[1], atol=0.1 * 0.39)
    low, high = model.extension.ci95.T
    assert (low < high).all()
    unseen = trials(101, hidden)
    assert error(model, unseen) < 0.8 * error(plain, unseen)


def test_given_values_are_held_and_take_the_place_of_what_is_fitted():
    hidden = ("current", (0.3, 0.0))
    model = fitted("calibrated+current[speed=0.3,to=0]", 1, hidden)
    np.testing.assert_allclose(model.extension.values[0], (0.3, 0.0), atol=1e-12)
    unseen = trials(101, hidden)
    assert error(model, unseen) < 1.1 * error(fitted("calibrated+current", 1, hidden), unseen)


def test_a_sensor_that_errs_is_found_beside_all_coefficients():
    hidden = ("heading_bias", (0.05,))
    model = fitted("calibrated+heading_bias", 1, hidden)
    assert model.extension.values[0][0] == pytest.approx(0.05, abs=0.01)


def test_a_delay_is_found_from_commands_alone():
    data = commanded(trials(1, ("rudder_delay", (3.0,))))
    model = make_predictor("calibrated+rudder_delay").fit(data)
    assert model.extension.values[0][0] == pytest.approx(3.0, abs=1.0)
    np.testing.assert_array_equal(model.predict(data.batch().s0, data.batch().U)[..., 6:], data.batch().U[..., :4])


def test_refinement_is_kept_only_where_it_predicts_the_validation_runs_better():
    whole = trials(1)
    train, valid = whole.with_runs(whole.runs[:6]), whole.with_runs(whole.runs[6:])
    model = Calibrated()
    model.fit(train, valid)
    start = Calibrated(refine=False).fit(train, valid)
    assert error(model, valid) <= 1.02 * error(start, valid)


def test_a_single_validation_run_is_no_reason_to_refine():
    whole = trials(1)
    train, valid = whole.with_runs(whole.runs[:7]), whole.with_runs(whole.runs[7:])
    one, other = (Calibrated(refine=refine).fit(train, valid) for refine in (True, False))
    np.testing.assert_array_equal(one.calibration.base, other.calibration.base)


def test_a_saved_model_predicts_the_same(tmp_path):
    hidden = ("current", (0.3, -0.25))
    model, batch = fitted("calibrated+current", 1, hidden), trials(101).batch()
    model.save(tmp_path / "model")
    again = make_predictor(str(tmp_path / "model"))
    np.testing.assert_array_equal(again.predict(batch.s0, batch.U), model.predict(batch.s0, batch.U))
    assert again.describe() == model.describe()


def test_the_description_names_prior_posterior_and_what_the_runs_do_not_determine():
    text = fitted("calibrated", 1).describe()
    assert "prior and posterior" in text
    assert "sway damping" in text
    undetermined = text.split("the prior stands): ")[1].splitlines()[0]
    assert "wind_X" in undetermined  # no wind is measured
    assert "p5" not in undetermined.split(", ")


@pytest.mark.parametrize("wrong", [1, "yes", None])
def test_refine_is_true_or_false(wrong):
    with pytest.raises(ValueError, match="accepted: true or false"):
        Calibrated(refine=wrong)


def test_what_is_fitted_already_is_no_effect_beside_it():
    with pytest.raises(InputError, match="fits the hull's coefficients already; leave it out"):
        make_predictor("calibrated+hull_derivatives")


def test_an_effect_beyond_its_bounds_is_refused():
    with pytest.raises(InputError, match="accepted"):
        make_predictor("calibrated+current[speed=90,to=0]").fit(trials(1))


def test_random_records_cover_what_is_measured_later():
    model, batch = fitted("calibrated", 1), trials(101).batch()
    records = model.predict_samples(batch.s0, batch.U, 60)
    assert records.shape == (60, *batch.U.shape[:2], 6)
    low, high = np.quantile(records, [0.05, 0.95], axis=0)
    truth = batch.truth[..., :6]
    inside = (truth >= low) & (truth <= high)
    assert 0.75 < inside.mean() < 0.99  # 8 runs: 0.9 is expected
    width = (high - low)[..., :2].mean(axis=(0, 2))
    assert width[-1] > 3.0 * width[4]  # errors grow


def test_random_records_depend_on_the_seed_alone(tmp_path):
    model, batch = fitted("calibrated", 1), trials(101).batch()
    one, two = (model.predict_samples(batch.s0[:2], batch.U[:2], 5, seed=seed) for seed in (0, 1))
    assert not np.array_equal(one, two)
    model.save(tmp_path / "model")
    again = make_predictor(str(tmp_path / "model")).predict_samples(batch.s0[:2], batch.U[:2], 5)
    np.testing.assert_array_equal(again, one)


def test_random_records_refuse_what_predict_refuses():
    model, batch = fitted("calibrated", 1), trials(101).batch()
    with pytest.raises(InputError, match="must be finite"):
        model.predict_samples(np.full_like(batch.s0, np.nan), batch.U)
