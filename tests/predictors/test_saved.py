"""Saved models: a damaged one, or one used on other data than it was made for, is one message; what is not fitted says
so."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from made_saved import signed_anew

from shipbench.bench.predict import predict_runs
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.data.files import write_dataset
from shipbench.errors import InputError
from shipbench.predictors._saved import Origin, check_origin, origin_of, read_meta, runs_of_training
from shipbench.predictors.base import make_predictor, parse_spec

SMALL = {"hold": "hold", "physics": "physics[iterations=1]", "mlp": "mlp[hidden=4,epochs=1]",
    "lstm": "lstm[hidden=4,epochs=1]",
         "neural_ode": "neural_ode[hidden=4,epochs=1]"}  # fmt: skip


@pytest.fixture(scope="session")
def fitted(harbour):
    few = harbour.subset(range(4))
    return {
        name: make_predictor(parse_spec(text)).fit(few, harbour.subset([4]), seed=0) for name, text in SMALL.items()
    }


@pytest.fixture
def saved(fitted, tmp_path):
    def save(name):
        fitted[name].save(tmp_path / name)
        return tmp_path / name

    return save


def _refused(folder):
    with pytest.raises(InputError, match=r"is not a saved model, or it is damaged|is not a saved"):
        make_predictor(parse_spec(str(folder)))


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "3", '{"predictor": ["hold"]}', '{"predictor": "hold", "params": 3}', "[" * 100_000, "\udcff"],
)
def test_a_damaged_description_is_one_message(saved, text):
    folder = saved("hold")
    (folder / "model.json").write_text(text, errors="surrogateescape")
    _refused(folder)


def test_files_cut_short_or_with_a_flipped_byte_are_one_message(saved):
    rng = np.random.default_rng(0)
    for name in ("model.json", "arrays.npz"):
        folder = saved("physics")
        whole = (folder / name).read_bytes()
        for at in rng.integers(0, len(whole), 60):
            (folder / name).write_bytes(whole[:at])
            _refused(folder)
            (folder / name).write_bytes(whole[:at] + bytes([whole[at] ^ (1 << int(rng.integers(8)))]) + whole[at + 1 :])
            try:
                make_predictor(parse_spec(str(folder)))
            except InputError:
                continue
            assert name == "model.json"  # a blank for another: the same content
            same = json.loads((folder / name).read_text())
            assert same == json.loads(whole)
        (folder / name).write_bytes(whole)
        make_predictor(parse_spec(str(folder)))


@pytest.mark.parametrize("name", ["physics", "mlp", "lstm", "neural_ode"])
def test_arrays_of_another_shape_are_refused_on_load(saved, name):
    folder = saved(name)
    with np.load(folder / "arrays.npz") as file:
        names = [n for n in file.files if n.removeprefix("physics.") not in ("q",)]
    for array in names:
        for change in (lambda a: a.ravel()[:-1], lambda a: np.array(["x"])):
            folder = saved(name)
            signed_anew(
                folder,
                change_arrays=lambda arrays, array=array, change=change: {**arrays, array: change(arrays[array])},
            )
            if name == "neural_ode" and array == "p" and change(np.zeros(2)).dtype.kind == "f":
                continue  # taken from the physics beneath
            _refused(folder)


@pytest.mark.parametrize(
    ("key", "value"), [("hidden", 10**9), ("hidden", -1), ("hidden", "x"), ("layers", 10**9), ("no_such", 1)]
)
def test_parameters_that_do_not_fit_the_arrays_are_refused_on_load(saved, key, value):
    folder = saved("mlp")
    signed_anew(folder, change_meta=lambda meta: {**meta, "params": {**meta["params"], key: value}})
    _refused(folder)


@pytest.mark.parametrize("dt", [0, -1.0, "x", float("nan"), float("inf"), None])
@pytest.mark.parametrize("name", ["hold", "physics", "mlp"])
def test_a_saved_model_has_a_sample_time(saved, name, dt):
    folder = saved(name)
    signed_anew(folder, change_meta=lambda meta: {**meta, "meta": {**meta["meta"], "dt": dt}})
    _refused(folder)


def _resampled(data, factor):
    runs = [replace(r, t=r.t * factor) for r in data.runs]
    return replace(data, dt=data.dt * factor, runs=tuple(runs))


@pytest.mark.parametrize("name", SMALL)
def test_data_at_another_sample_time_are_refused(saved, harbour, name):
    with pytest.raises(InputError, match=r"steps 1 s; data set '.*' is sampled at 0.5 s. Accepted: data at 1 s"):
        predict_runs(str(saved(name)), _resampled(harbour, 0.5))


def test_a_model_saved_before_its_origin_was_kept_refuses_another_sample_time_too(saved, harbour):
    folder = saved("neural_ode")
    meta = json.loads((folder / "model.json").read_text())
    (folder / "model.json").write_text(json.dumps({k: v for k, v in meta.items() if k not in ("made_for", "digest")}))
    with pytest.raises(InputError, match="steps 1 s"):
        predict_runs(str(folder), _resampled(harbour, 2.0))
    assert len(predict_runs(str(folder), harbour.subset([0]))) == 1


def test_runs_of_a_model_s_own_training_are_told(harbour, tmp_path):
    model = make_predictor("physics")
    model.fit(harbour.subset([0, 1, 2]))
    model.save(tmp_path / "model")
    origin = origin_of(read_meta(tmp_path / "model"))
    (note,) = check_origin("mine", origin, harbour.subset([1, 2, 3, 4]))
    assert note == (
        "the saved model mine was fitted on 2 of the 4 runs: there its errors are not those of a prediction"
    )
    assert check_origin("mine", origin, harbour.subset([3, 4])) == []


def test_a_run_is_of_the_training_where_a_window_of_it_was(harbour):
    """As a study does, whose horizon is shorter than the runs."""
    windows = harbour.subset([0, 1, 2]).windows(15)
    origin = Origin.of(windows.with_runs(run for run in windows if not run.id.startswith("run2")))
    assert runs_of_training(origin, harbour.subset([1, 2, 3])) == 1
    assert runs_of_training(Origin(1.0, harbour.inputs), harbour) == 0


def test_other_channels_are_refused(saved, harbour):
    names = (*harbour.inputs, "depth")
    runs = [
        replace(r, inputs=np.column_stack([r.inputs, np.full(len(r), 20.0)]), inputs_names=names) for r in harbour.runs
    ]
    with pytest.raises(InputError, match=r"the model uses the inputs n_c, delta_c, F_b_c, F_s_c; data set .* depth"):
        predict_runs(str(saved("mlp")), harbour.with_runs(runs))


def test_a_study_refuses_another_sample_time_before_it_writes_anything(saved, harbour, tmp_path):
    write_dataset(_resampled(harbour, 0.5), tmp_path / "half")
    task = make_task(
        {"dataset": str(tmp_path / "half"), "models": ["hold", str(saved("hold"))], "horizon_s": 10.0, "folds": 2}
    )
    with pytest.raises(InputError, match=r"steps 1 s; .* sampled at 0.5 s"):
        run_tasks([task], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_another_ship_is_told_in_the_study_and_on_the_terminal(saved, harbour, tmp_path, caplog):
    longer = replace(
        harbour.subset(range(4)), ship=harbour.ship.model_copy(update={"L": 1.05 * harbour.ship.L, "name": "long"})
    )
    write_dataset(longer, tmp_path / "long")
    task = make_task({"dataset": str(tmp_path / "long"), "models": [str(saved("hold"))], "horizon_s": 10.0, "folds": 2})
    outcome = run_tasks([task], tmp_path / "out")
    told = (
        f"fitted on ship '{harbour.ship.name}'; these data are of another: L = {1.05 * harbour.ship.L:.4g} m "
        f"(model: {harbour.ship.L:.4g})"
    )
    assert told in caplog.text
    assert any(told in note for note in outcome.summaries[0]["notes"])


@pytest.mark.parametrize("name", [*SMALL, "oracle", "sklearn:Ridge"])
def test_what_is_not_fitted_neither_predicts_nor_saves(harbour, tmp_path, name):
    model, batch = make_predictor(parse_spec(SMALL.get(name, name))), harbour.batch()
    with pytest.raises(InputError, match="predict was called before fit"):
        model.predict(batch.s0, batch.U)
    with pytest.raises(InputError, match="save was called before fit"):
        model.save(tmp_path / "x")


@pytest.mark.parametrize("name", SMALL)
def test_arrays_with_negative_strides_are_taken(fitted, harbour, name):
    batch = harbour.subset(range(3)).batch()
    turned = fitted[name].predict(batch.s0[::-1], batch.U[::-1])[::-1]
    np.testing.assert_allclose(turned, fitted[name].predict(batch.s0, batch.U), rtol=1e-12, atol=1e-9)


def test_what_is_no_array_of_numbers_is_one_message(fitted, harbour):
    with pytest.raises(InputError, match="cannot be read as numbers"):
        fitted["hold"].predict("x", harbour.batch().U)
