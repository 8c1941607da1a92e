"""An FMU as a model: simulated as its equations say, calibrated, saved; a crash, a hang and an error."""

from __future__ import annotations

import copy
import os
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from made_fmu import STATES, TEN, TRUE, description, members, sail_fmu, write_archive

from shipbench.api import benchmark
from shipbench.bench.submissions import read_results
from shipbench.bench.twins import simulate_like
from shipbench.contract.check import check_model
from shipbench.errors import InputError, WorkError
from shipbench.exporting.formats import export
from shipbench.predictors.base import make_predictor
from shipbench.records import Dataset

MAPPED = '[inputs]\nn_c = "n_c"\ndelta_c = "delta_c"\n[outputs]\n{outputs}\n[start]\n{start}\n'


@pytest.fixture(scope="module")
def trial() -> Dataset:
    return sail_fmu(4, 40)


@pytest.fixture
def fmu(tmp_path, fmu_library):
    """Function that writes an FMU: version of FMI, values of its parameters, constants of its mapping."""

    def write(fmi: int = 2, constants: str = "", **values: float) -> Path:
        path = tmp_path / "ship.fmu"
        if constants:
            rows = "\n".join(f'{s} = "{s}"' for s in STATES)
            text = MAPPED.format(outputs=rows, start=rows) + f"[constants]\n{constants}\n"
            path.with_name("ship.fmu.toml").write_text(text)
        files: dict[str, str | bytes] = {
            "modelDescription.xml": description(fmi, values=values),
            **members(fmu_library(fmi), fmi),
        }
        return write_archive(path, files)

    return write


def predicted(model, data: Dataset) -> np.ndarray:
    batch = data.batch()
    return model.predict(batch.s0, batch.U)


@pytest.mark.parametrize(
    ("fmi", "kind"),
    [
        (2, "co-simulation"),
        (3, "model-exchange"),
        pytest.param(3, "co-simulation", marks=pytest.mark.long),
        pytest.param(2, "model-exchange", marks=pytest.mark.long),
    ],
)
def test_it_simulates_what_its_equations_say(fmi, kind, ship_fmu, trial):
    """Co-simulation integrates by the rule of the test's own loop, model exchange by one of order 4."""
    model = make_predictor(f"{ship_fmu(fmi)}[kind={kind},workers=1]").fit(trial)
    first = predicted(model, trial)
    np.testing.assert_allclose(first, trial.batch().truth, atol=1e-9 if kind == "co-simulation" else 0.05)
    np.testing.assert_array_equal(predicted(model, trial), first)  # reset per run: no state of the runs before


def test_inputs_that_were_changed_in_place_are_sent_again(ship_fmu, trial):
    model, batch = make_predictor(f"{ship_fmu()}[workers=1]").fit(trial), trial.batch()
    U = np.ascontiguousarray(batch.U)
    first = model.predict(batch.s0, U)
    U[..., 1] = 0.0
    assert np.abs(model.predict(batch.s0, U)[..., 5] - first[..., 5]).max() > 1e-3


def test_open_parameters_are_calibrated_within_their_bounds(fmu, trial):
    path = fmu(Xuu=2.0 * TRUE["Xuu"], Nd=0.6 * TRUE["Nd"])
    model = make_predictor(f"{path}[fit=[Xuu,Nd],workers=1]").fit(trial)
    np.testing.assert_allclose(model.values, [TRUE["Xuu"], TRUE["Nd"]], rtol=1e-6)
    np.testing.assert_allclose(predicted(model, trial), trial.batch().truth, atol=1e-4)
    assert model.num_parameters == 2
    assert "Xuu = -0.0004 +-" in model.describe()
    assert "0 in typical sizes" not in model.describe()


def test_a_bound_holds_and_is_reported(fmu, trial):
    path = fmu(constants="lag = 3.0\n[bounds]\nNd = [-4e-5, -1e-5]")
    model = make_predictor(f"{path}[fit=Nd,workers=1]").fit(trial)
    assert model.values[0] == pytest.approx(-4e-5, rel=1e-3)
    assert "bounds -4e-05 to -1e-05 (at its bound)" in model.describe()


@pytest.mark.long
def test_ten_parameters_on_twenty_runs_come_back(fmu):
    rng, data = np.random.default_rng(1), sail_fmu(20, 120)
    path = fmu(**{name: TRUE[name] * float(rng.uniform(0.5, 1.8)) for name in TEN})
    began = time.perf_counter()
    model = make_predictor(f"{path}[fit=[{','.join(TEN)}]]").fit(data)
    assert time.perf_counter() - began < 60.0
    np.testing.assert_allclose(model.values, [TRUE[name] for name in TEN], rtol=1e-6)


@pytest.mark.parametrize(
    ("trouble", "message"),
    [
        (1, r"ship\.fmu crashed \(SIGSEGV\) at t = 6 s of a run\. Correct the FMU"),
        (2, r"ship\.fmu gave no answer within 0\.5 s and was stopped at t = 6 s.*\[limit=1\]"),
        (3, r"ship\.fmu: doStep failed with status 3 at t = 6 s\. rudder lost after 6 s"),
    ],
)
def test_a_crash_a_hang_and_an_error_are_one_message_each(trouble, message, fmu, trial):
    model = make_predictor(f"{fmu(constants=f'trouble = {trouble}')}[limit=0.5,workers=1]").fit(trial)
    with pytest.raises(WorkError, match=message):
        predicted(model, trial)
    assert model._crew is not None
    assert len(model._crew._workers) == (trouble == 3)  # an error that the FMU reports leaves its process alive


def test_a_reset_that_leaves_something_behind_is_noticed(fmu, trial):
    model = make_predictor(f"{fmu(constants='trouble = 4')}[workers=1]").fit(trial)
    np.testing.assert_allclose(predicted(model, trial), trial.batch().truth, atol=1e-9)


def test_a_run_that_fails_is_a_row_and_the_others_are_predicted(ship_fmu, trial, caplog):
    batch = trial.batch()
    s0 = batch.s0.copy()
    s0[1, 3:6] = 1e200
    S = make_predictor(f"{ship_fmu()}[workers=1]").fit(trial).predict(s0, batch.U)
    assert np.isnan(S[1]).all()
    np.testing.assert_allclose(S[[0, 2, 3]], batch.truth[[0, 2, 3]], atol=1e-9)
    assert "fails in 1 of 4 runs: its outputs are not finite at t = 1 s" in caplog.text


def test_data_without_an_input_of_the_fmu_are_skipped(tmp_path, trial):
    extra = '<ScalarVariable name="wind_speed" valueReference="9" causality="input"><Real start="0"/></ScalarVariable>'
    files = {"modelDescription.xml": description(2, extra=extra), "sources/ship.c": "not needed here"}
    path = write_archive(tmp_path / "ship.fmu", files)
    model = make_predictor(str(path))
    assert model.skip(trial) == (
        "the FMU needs the input wind_speed, which the data have not. Give it a value in [constants] of its mapping"
    )
    with pytest.raises(InputError, match="wind_speed"):
        model.fit(trial)


def test_a_saved_model_predicts_the_same_and_only_with_its_own_fmu(fmu, trial, tmp_path):
    path = fmu(Xuu=1.5 * TRUE["Xuu"])
    model = make_predictor(f"{path}[fit=[Xuu],workers=1]").fit(trial)
    model.save(tmp_path / "saved")
    again = make_predictor(str(tmp_path / "saved"))
    np.testing.assert_array_equal(predicted(again, trial), predicted(model, trial))
    fmu(Xuu=1.6 * TRUE["Xuu"])
    with pytest.raises(InputError, match="is not the FMU that the model was fitted with"):
        make_predictor(str(tmp_path / "saved"))
    meta = tmp_path / "saved/model.json"
    meta.write_text(meta.read_text().replace(str(path), "ship.fmu"))
    with pytest.raises(InputError, match=r"damaged|without its folder"):
        make_predictor(str(tmp_path / "saved"))


def test_a_twin_is_not_made_by_an_fmu_that_is_calibrated_to_the_trial(ship_fmu, trial):
    with pytest.raises(InputError, match="must be fitted before it can simulate"):
        simulate_like(f"{ship_fmu()}[fit=[Xuu],workers=1]", trial)


@pytest.mark.long
def test_a_copy_has_processes_of_its_own(ship_fmu, trial):
    model = make_predictor(f"{ship_fmu()}[workers=1]").fit(trial)
    first = predicted(model, trial)
    np.testing.assert_array_equal(predicted(copy.deepcopy(model), trial), first)


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_exported_model_predicts_the_same_as_an_fmu(fmi, harbour, tmp_path, fmu_library):
    physics = make_predictor("physics+current[speed=0.4,to=1.0]").fit(harbour)
    physics.save(tmp_path / "model")
    path = export(str(tmp_path / "model"), "fmu", tmp_path / "ship.fmu", fmi=fmi)
    model = make_predictor(str(path)).fit(harbour)
    expected = predicted(physics, harbour)
    np.testing.assert_allclose(predicted(model, harbour), expected, rtol=1e-9, atol=1e-9)
    assert not model.learns


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_it_keeps_the_contract(fmi, ship_fmu):
    report = check_model(f"{ship_fmu(fmi)}[workers=1]")
    assert not report.of("broken"), report
    assert {v.rule for v in report.of("not applicable")} == {"translation", "rotation"}  # it may know its place


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ("fits=[Xuu]", "has no parameter 'fits'. Did you mean 'fit'"),
        ("fit=[Xuv]", "unknown parameter in fit of .*'Xuv'. Did you mean 'Xvr|Did you mean 'Xuu'"),
        ("fit=[trouble]", r"'trouble' .* has the bounds nan to nan; .*\[bounds\] trouble = "),
        ("kind=magic", "kind = magic; accepted: model-exchange, co-simulation|co-simulation, model-exchange"),
        ("limit=0", "limit = 0; accepted: a number of at least 0.001"),
        ("step=fast", "step = fast; accepted: a number"),
    ],
)
def test_wrong_settings_are_named(params, message, ship_fmu):
    with pytest.raises(InputError, match=message):
        make_predictor(f"{ship_fmu()}[{params}]")


def test_a_step_that_does_not_divide_the_sample_time_is_refused(ship_fmu, trial):
    model = make_predictor(f"{ship_fmu()}[step=0.3]").fit(trial)
    with pytest.raises(InputError, match=r"step = 0.3 s; accepted: a whole part of .* 1 s, such as 0.25"):
        predicted(model, trial)


def test_a_name_without_a_file_and_a_missing_package_are_one_message(ship_fmu, monkeypatch):
    with pytest.raises(InputError, match=r"'fmu' is made of a file\. Accepted: .*path\.fmu"):
        make_predictor("fmu")
    with pytest.raises(InputError, match=r"cannot read .*none\.fmu"):
        make_predictor("none.fmu")
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(InputError, match=r"needs fmpy, which is not installed.*pip install 'shipbench\[fmu\]'"):
        make_predictor(str(ship_fmu()))


def test_an_fmu_for_another_platform_is_refused_when_it_is_made(tmp_path):
    files = {"modelDescription.xml": description(), "binaries/win64/ship.dll": "MZ"}
    with pytest.raises(InputError, match=r"has libraries for win64 and no source; needed: \w+ \(ship\.\w+\)"):
        make_predictor(str(write_archive(tmp_path / "ship.fmu", files)))


@pytest.mark.long
def test_in_a_study_a_crash_fails_its_own_rows(fmu, tmp_path, toy_folder, undrawn):
    path = fmu(constants="trouble = 1")
    benchmark([f"{path}[workers=1]", "hold"], toy_folder(), horizon=20, folds=2, out=tmp_path / "out", quiet=True)
    rows = read_results(tmp_path / "out").rows
    assert set(rows[rows["model"] == "hold"]["status"]) == {"ok"}
    broken = rows[rows["model"] != "hold"]
    assert set(broken["status"]) == {"failed"}
    assert "crashed (SIGSEGV)" in broken["reason"].iloc[0]


@pytest.mark.long
def test_the_processes_end_with_their_parent(fmu, tmp_path):
    """Also where the parent is killed while its FMU hangs."""
    path = fmu(constants="trouble = 2")
    code = (
        "import sys; sys.path.insert(0, sys.argv[2])\n"
        "from made_fmu import sail_fmu\nfrom shipbench.predictors.base import make_predictor\n"
        "data = sail_fmu(1, 20); b = data.batch()\nmake_predictor(sys.argv[1]).fit(data).predict(b.s0, b.U)"
    )
    parent = psutil.Popen([sys.executable, "-c", code, str(path), os.path.dirname(__file__) + "/.."])
    end, children = time.monotonic() + 30.0, list[psutil.Process]()
    while not children and time.monotonic() < end:
        children = [p for p in parent.children() if "fmu_model" in " ".join(p.cmdline())]
        time.sleep(0.1)
    assert children
    time.sleep(2.0)
    parent.kill()
    parent.wait()
    _, alive = psutil.wait_procs(children, timeout=10.0)
    assert not alive
