"""How many numbers a fit sets, of our models and of others'."""

from __future__ import annotations

import re

import pytest
import torch

from shipbench.bench.cost import count_parameters, parameters_by_model
from shipbench.predictors.base import make_predictor, parse_spec


class Said:
    num_parameters = 12


class Method:
    def num_parameters(self):
        return 13


class Torch:
    def __init__(self):
        self.net = torch.nn.Linear(3, 2)


class Broken:
    @property
    def num_parameters(self):
        raise RuntimeError("no")


@pytest.mark.parametrize(
    ("model", "count"), [(Said(), 12), (Method(), 13), (Torch(), 8), (Broken(), None), (object(), None)]
)
def test_foreign_models(model, count):
    assert count_parameters(model) == count


@pytest.mark.long
def test_ours_count_weights_and_physics_once(harbour):
    train, valid = harbour.subset(range(10)), harbour.subset(range(10, 12))

    def count(spec):
        return count_parameters(make_predictor(parse_spec(spec)).fit(train, valid, seed=0))

    assert count("hold") == 0
    assert count("physics[iterations=2]") == 11 + 6  # p0 to p10 and the actuators' six
    assert count("mlp[epochs=1,hidden=5]") == 11 * 5 + 5 + 2 * (5 * 5 + 5) + 5 * 7 + 7
    net = 7 * 4 + 4 + 4 * 4 + 4 + 4 * 3 + 3
    assert count("neural_ode[epochs=1,hidden=4]") == 11 + 6 + net


def test_adapters_count_coefficients_and_not_what_they_keep_for_loading(harbour):
    pytest.importorskip("sklearn")
    train = harbour.subset(range(6))

    def count(spec):
        return count_parameters(make_predictor(parse_spec(spec)).fit(train, seed=0))

    features = 7 + 4
    assert count("sklearn:Ridge") == count("sklearn:BayesianRidge") == 7 * (features + 1)
    assert count("sklearn:DecisionTreeRegressor[max_depth=2]") is None
    pytest.importorskip("pysindy")
    sparse = make_predictor(parse_spec("pysindy")).fit(train, seed=0)
    equations = sparse.describe().split("divided by")[0]
    assert count_parameters(sparse) == 6 + len(
        re.findall(r" [+-][\d.]+", equations)
    )  # the actuators, and what the equations show


def test_the_table_has_the_mean_over_cells_of_those_that_tell():
    assert parameters_by_model([{"model": "a", "parameters": 4}, {"model": "a", "parameters": 6}, {"model": "b"}]) == {
        "a": 5.0
    }
