"""Model specs: lists as values, and seeds that generators take."""

from __future__ import annotations

import pytest

from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor
from shipbench.specs import parse_spec


@pytest.mark.parametrize("text", ["(20,20)", "[20,20]", "( 20, 20 )", "[20, 20]"])
def test_a_list_is_one_value(text):
    spec = parse_spec(f"sklearn:MLPRegressor[hidden_layer_sizes={text},max_iter=30]")
    assert spec.params == {"hidden_layer_sizes": [20, 20], "max_iter": 30}
    assert make_predictor(spec).params == spec.params


def test_a_list_does_not_end_the_bracket_of_an_effect():
    spec = parse_spec("physics[iterations=3]+current[speed=[1,2],to=1.0]+wind")
    assert spec.params == {"iterations": 3}
    assert [(e.name, e.params) for e in spec.effects] == [("current", {"speed": [1, 2], "to": 1.0}), ("wind", {})]
    with pytest.raises(InputError, match="speed"):
        make_predictor(spec)


@pytest.mark.parametrize("seed", ["x", "-1", "1.5", "true", "99999999999999999999999999", "[1]", "Infinity"])
def test_a_seed_that_no_generator_takes_is_refused(seed):
    with pytest.raises(InputError, match=r"seed = .*; accepted: a whole number from 0 to 4294967295"):
        parse_spec(f"mlp[seed={seed}]")


@pytest.mark.parametrize(
    "value",
    [
        "hidden=0",
        "hidden=x",
        "hidden=1e3",
        "hidden=1000000000",
        "epochs=NaN",
        "lr=Infinity",
        "lr=-1",
        "layers=true",
        "batch=null",
    ],
)
def test_numbers_of_a_model_have_bounds(value):
    key = value.partition("=")[0]
    with pytest.raises(InputError, match=rf"{key} = .*; accepted: .* at most"):
        make_predictor(parse_spec(f"mlp[{value}]"))


def test_a_mistyped_parameter_gets_the_nearest():
    with pytest.raises(
        InputError, match=r"^'mlp' has no parameter 'epoch'. Did you mean 'epochs'\? Accepted: batch, device"
    ):
        make_predictor(parse_spec("mlp[epoch=3]"))


def test_a_spec_may_be_longer_than_a_file_name():
    assert len(parse_spec("physics" + "+current" * 40).effects) == 40
