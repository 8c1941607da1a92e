"""`shipbench check`: a model that keeps the contract passes, and each way to break a rule is found by exactly that
rule."""

from __future__ import annotations

import io
import json
import pickle
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.contract.base import BROKEN, NOT_APPLICABLE, PASSED
from shipbench.contract.check import check_model
from shipbench.contract.rules import RULES
from shipbench.contract.saving import pickle_in
from shipbench.contract.small import few_windows, small_harbour
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor, parse_spec

STRANGERS = Path(__file__).with_name("strangers.py")

BROKEN_BY = {
    "FitRaises": "fit", "TakesAnything": "parameters", "IgnoresItsParameter[lag=20.0]": "parameters",
    "ForgetsItsParameterInFit[lag=20.0]": "parameters", "ReturnsNothing": "fit_returns", "NeedsValid": "valid_optional",
    "CentresTheData": "fit_inputs", "NeedsHistory": "history", "KnowsNoHistory": "history", "GivesS0Too": "shape",
    "GivesNaN": "shape",
    "OnlyTheTrainedHorizon": "shape", "GivesLists": "dtype", "RefusesFloat32": "dtype", "OneStepLate": "start",
    "Counts": "repeatable",
    "DrawsWhenAsked": "repeatable", "WritesIntoS0": "predict_inputs", "WritesIntoHistory": "predict_inputs",
    "NeedsABatch": "single_run",
    "MixesTheBatch": "batch", "KnowsItsPlaceInTheBatch": "batch", "SeesTheNextOrder": "causality",
    "ScalesByTheWholeHorizon": "causality",
    "WrapsItsHeading": "heading", "KnowsItsHarbour": "translation", "PrefersNorth": "rotation",
    "IgnoresItsSeed": "seed",
    "DrawsFromTheGlobalGenerator": "seed", "RaisesWhenItDiverges": "diverging", "StopsAllWhenOneDiverges": "diverging",
    "HidesNaN": "not_finite", "SpreadsNaN": "not_finite", "TripsOverNaN": "not_finite", "Pickles": "saved",
    "PicklesInsideNpz": "saved",
    "RoundsWhenSaved": "saved", "CannotLoad": "saved",
}  # fmt: skip


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """The spec of a stranger's class."""
    file = tmp_path_factory.mktemp("theirs") / "strangers.py"
    shutil.copy(STRANGERS, file)
    return lambda name: f"{file}:{name}"


@pytest.fixture(scope="module")
def data():
    """Made once for all of these checks."""
    return small_harbour()


def shipbench(*arguments: str):
    return CliRunner().invoke(app, [*arguments])


def test_a_model_that_keeps_the_contract_passes_every_rule(stranger, data):
    report = check_model(stranger("Good[lag=20.0]"), data)
    assert {v.rule: v.evidence for v in report.verdicts if v.status != PASSED} == {}
    assert [v.rule for v in report.verdicts] == [r.name for r in RULES]


def test_the_docs_say_how_many_rules_there_are():
    assert f"({len(RULES)} rules" in (Path(__file__).parents[2] / "docs/add-a-model.md").read_text()


def test_every_rule_has_a_model_that_breaks_it():
    assert set(BROKEN_BY.values()) == {r.name for r in RULES}


@pytest.mark.parametrize(("model", "rule"), BROKEN_BY.items())
def test_a_broken_model_is_caught_by_exactly_its_rule(stranger, data, model, rule):
    report = check_model(stranger(model), data)
    assert {v.rule: v.evidence for v in report.of(BROKEN)}.keys() == {rule}, report.of(BROKEN)


def test_what_cannot_be_saved_is_not_applicable_with_the_reason(stranger, data):
    (verdict,) = check_model(stranger("CannotSave"), data).of(NOT_APPLICABLE)
    assert verdict.rule == "saved"
    assert "no save(path)" in verdict.evidence


def test_earth_fixed_data_and_models_are_not_turned():
    windy = small_harbour(inputs=("n_c", "delta_c", "F_b_c", "F_s_c", "wind_speed", "wind_from"))
    assert {v.rule for v in check_model("hold", windy).of(NOT_APPLICABLE)} == {"rotation"}
    moored = check_model("physics[iterations=1]+current[speed=0.3,to=1.0]")
    assert {v.rule for v in moored.of(NOT_APPLICABLE)} == {"translation", "rotation"}
    assert moored.of(BROKEN) == []


def test_a_saved_model_is_checked_without_a_fit(tmp_path, data):
    make_predictor(parse_spec("hold")).fit(data).save(tmp_path / "m")
    report = check_model(str(tmp_path / "m"))
    assert report.of(BROKEN) == []
    assert {v.rule for v in report.of(NOT_APPLICABLE)} == {
        "fit",
        "parameters",
        "fit_returns",
        "valid_optional",
        "fit_inputs",
        "seed",
    }


def test_a_saved_model_with_measured_wind_gets_wind(tmp_path):
    names = ("n_c", "delta_c", "F_b_c", "F_s_c", "wind_speed", "wind_from", "depth")
    make_predictor(parse_spec("hold")).fit(small_harbour(inputs=names)).save(tmp_path / "m")
    assert check_model(str(tmp_path / "m")).of(BROKEN) == []
    with pytest.raises(InputError, match=r"the saved model uses the inputs .*wind_speed"):
        check_model(str(tmp_path / "m"), small_harbour())


def test_the_command_prints_every_rule_and_the_exit_code_says_what_came_of_it(stranger):
    good, bad = shipbench("check", stranger("Good")), shipbench("check", stranger("NeedsABatch"))
    assert (good.exit_code, bad.exit_code) == (0, 1), good.output + bad.output
    for rule in RULES:
        assert f"{rule.name}  passed" in good.stdout
    assert f"{len(RULES)} rules passed, 0 broken, 0 not applicable" in " ".join(good.stdout.split())
    assert "BROKEN" in bad.stdout
    assert good.stdout.count("evidence: ") == len(RULES)
    assert "what it says: " not in good.stdout
    assert bad.stdout.count("what it says: ") == 1
    assert "raised ValueError: give a batch" in " ".join(bad.stdout.split())


def test_json_is_one_document_and_nothing_else(stranger):
    result = shipbench("check", stranger("NeedsABatch"), "--json")
    document = json.loads(result.stdout)
    assert (result.exit_code, document["broken"], document["passed"]) == (1, 1, len(RULES) - 1)
    (broken,) = [r for r in document["rules"] if r["status"] == "broken"]
    assert broken["rule"] == "single_run"
    assert broken["evidence"].endswith("raised ValueError: give a batch")


SPOILED = """
import subprocess, sys
print("loaded")
def prints(s0, U, dt):
    print("step")
    subprocess.run(["echo", "solver"])
    return s0[:, None] + 0.0 * U.sum()
def leaves(s0, U, dt):
    sys.exit(3)
"""


def test_what_a_model_prints_is_not_in_the_document(tmp_path, capfd):
    (tmp_path / "sim.py").write_text(SPOILED)
    with pytest.raises(SystemExit):
        app(["check", f"{tmp_path}/sim.py:prints", "--json"])
    out, err = capfd.readouterr()
    assert json.loads(out)["broken"] > 0
    assert {"loaded", "step", "solver"} <= set(err.split())


def test_a_model_that_ends_the_process_breaks_a_rule_and_rules_behind_it_are_one_line(tmp_path):
    (tmp_path / "sim.py").write_text(SPOILED)
    result = shipbench("check", f"{tmp_path}/sim.py:leaves")
    words = " ".join(result.stdout.split())
    assert result.exit_code == 1
    assert "raised SystemExit: 3" in words
    assert words.index("BROKEN") < words.index("passed evidence")
    assert "Not tried, since a rule before them is broken:" in words
    assert "start, repeatable, predict_inputs" in words


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("lstn", "Did you mean 'lstm'"), ("nowhere.py:Model", "does not exist"), ("hold[x=1]", "has no parameter"),
        ("mlp[", "cannot be read"),
        ("{file}:Nobody", "unknown class"), ("{spoiled}:Model", "cannot be made: SyntaxError"),
        ("{file}:Path", "has no method fit"),
        ("mlp:Ridge", "'mlp' takes no ':Ridge'"), ("sklearn", "names no regressor"),
        ("sklearn:Rigde", "Did you mean 'Ridge'"),
        ("sklearn:Ridge[alhpa=1]", "Did you mean 'alpha'"), ("sklearn:StackingRegressor", "needs no other estimator"),
    ],
)  # fmt: skip
def test_bad_input_is_one_message_and_exit_code_two(stranger, tmp_path, spec, says):
    spoiled = tmp_path / "spoiled.py"
    spoiled.write_text("class Model(:\n")
    result = shipbench("check", spec.format(file=stranger("").rstrip(":"), spoiled=spoiled))
    assert (result.exit_code, result.output.count("\n")) == (2, 1), result.output
    assert says in result.output


def test_the_oracle_is_not_checked_on_data_that_were_not_simulated(data):
    with pytest.raises(
        InputError, match="cannot be checked here: data set 'small_harbour' was not made by this simulator"
    ):
        check_model("oracle", small_harbour(inputs=("n_c", "delta_c", "F_b_c", "F_s_c", "depth")))


def test_a_data_set_is_cut_into_a_few_windows(data):
    assert len(few_windows(small_harbour(num=9, horizon=90))) == 16
    with pytest.raises(InputError, match="2 windows of 30 steps; the check needs 6"):
        few_windows(data.subset(range(2)))


def test_pickles_are_told_from_other_files_without_reading_them_in():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("archive/data.pkl", pickle.dumps({"weights": 1}))
    arrays = io.BytesIO()
    np.savez(arrays, a=np.arange(3.0), b=np.array(["text"]))
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        assert pickle_in("a.bin", pickle.dumps([1.5, "x"], protocol))
    assert pickle_in("model.pt", packed.getvalue()) == "model.pt: archive/data.pkl is a pickle"
    for name, harmless in (
        ("a.json", b'{"a": 1}'),
        ("a.txt", b"1.5\n2.5\n"),
        ("a.npz", arrays.getvalue()),
        ("empty", b""),
    ):
        assert pickle_in(name, harmless) == "", name
