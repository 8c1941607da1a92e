"""The contract, put to every registered predictor: a new one is tested by existing. The rules stand in
`shipbench.contract`."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.contract.base import PASSED
from shipbench.contract.check import check_subject
from shipbench.contract.rules import RULES
from shipbench.contract.small import small_harbour
from shipbench.contract.subject import Subject
from shipbench.errors import InputError
from shipbench.predictors import neural_ode
from shipbench.predictors.base import PREDICTORS, parse_spec
from shipbench.specs import READERS

SMALL = {
    "mlp": "mlp[epochs=2]",
    "lstm": "lstm[epochs=2,hidden=8]",
    "neural_ode": "neural_ode[epochs=2]",
    "physics": "physics[iterations=3]",
    "sklearn": "sklearn:DecisionTreeRegressor[max_depth=4]",
}
"""Quick settings of the predictors that train; the others take none."""


@pytest.fixture(scope="module")
def data():
    """Few minibatches of the neural ODE: its rules are judged, not how well it is trained."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(neural_ode._Windows, "MINIBATCHES", 3)
        yield small_harbour()


@pytest.fixture(scope="module", params=[name for name in PREDICTORS.names() if name not in READERS])
def subject(request, data):
    return Subject(parse_spec(SMALL.get(request.param, request.param)), data)


@pytest.fixture(scope="module")
def verdicts(subject):
    return {v.rule: v for v in check_subject(subject).verdicts}


@pytest.mark.parametrize("rule", [r.name for r in RULES])
def test_a_built_in_model_keeps_every_rule(verdicts, rule):
    assert verdicts[rule].status == PASSED, verdicts[rule].evidence


def test_the_first_prediction_lies_one_step_from_s0(subject):
    assert np.abs(subject.S[:, 0, :2] - subject.batch.s0[:, :2]).max() < 15.0


@pytest.mark.parametrize("fault", ["state", "inputs", "nan", "empty"])
def test_bad_input_is_named(subject, fault):
    """Beyond the contract: shipbench's own models refuse by name what a stranger's may trip over."""
    batch = subject.batch
    s0, U = batch.s0.copy(), batch.U.copy()
    if fault == "state":
        s0 = s0[:, :7]
    elif fault == "inputs":
        U = U[..., :3]
    elif fault == "nan":
        U[0, 5, 1] = np.nan
    else:
        U = U[:, :0]
    with pytest.raises(InputError, match=r"accepted|finite"):
        subject.model.predict(s0, U)
