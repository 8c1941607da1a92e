"""The runner: no leak, statuses with reasons, resume, and results that can be computed again."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from shipbench.bench.results import PROTOCOL, Cell, read_truth, rescore
from shipbench.bench.runner import _outcome_text, run_tasks
from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.errors import InputError

MODELS = '''
import json, os
from pathlib import Path
import numpy as np

LOG = Path(__file__).with_suffix(".log")

class Spy:
    """Holds the state and writes down what it was shown."""
    seen = ()
    def fit(self, train, valid=None, *, seed=0):
        ids = [r.id for r in valid.runs] if valid else []
        entry = {"train": [r.id for r in train.runs], "valid": ids, "seed": seed}
        with LOG.open("a") as f:
            f.write(json.dumps(entry) + "\\n")
        self.seen = {row.tobytes() for d in (train, valid) if d for r in d.runs for row in r.states}
        return self
    def predict(self, s0, U, history=None):
        assert not self.seen & {row.tobytes() for row in s0}
        assert s0.base is None and U.base is None  # nothing behind the arrays
        S = np.repeat(s0[:, None], U.shape[1], axis=1)
        s0 += 1e9
        U += 1e9
        return S

class Together(Spy):
    calls = []
    @classmethod
    def fit_group(cls, models, trains, valids, seeds):
        cls.calls.append(len(models))
        for m, t, v, s in zip(models, trains, valids, seeds):
            m.fit(t, v, seed=s)

class Explodes(Spy):
    def predict(self, s0, U, history=None):
        S = np.repeat(s0[:, None], U.shape[1], axis=1)
        S[0, 4:, 3] = np.inf
        S[1, 7:, 0] = 2e5
        return S

class FailsToFit(Spy):
    def fit(self, train, valid=None, *, seed=0):
        raise ZeroDivisionError("no data\\nat all")

class FailsToPredict(Spy):
    def predict(self, s0, U, history=None):
        raise KeyError("u")

class ReturnsS0(Spy):
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1] + 1, axis=1)

class NotForThis(Spy):
    def skip(self, dataset):
        return f"{dataset.name} is too calm"
'''


@pytest.fixture
def study(toy, tmp_path, monkeypatch):
    """Runs models of the file above on the toy ship; the data set's options are the keyword arguments of `toy`."""
    file = tmp_path / "models.py"
    file.write_text(MODELS)
    sets: dict = {}
    monkeypatch.setattr("shipbench.bench.runner.load_dataset", lambda name: sets[name])

    def run(*models, out="out", resume=False, task=None, **data):
        sets["toy"] = toy(**{"runs": 6, **data})
        specs = [m if m in ("hold", "oracle") else f"{file}:{m}" for m in models]
        task = make_task({"dataset": "toy", "models": specs, "horizon_s": 20, "folds": 3, **(task or {})})
        return run_tasks([task], tmp_path / out, resume=resume, command="shipbench run test")

    run.file, run.out, run.sets = file, tmp_path / "out", sets
    return run


def log(study):
    return [json.loads(line) for line in study.file.with_suffix(".log").read_text().splitlines()]


def test_one_row_per_model_fold_seed_and_run(study):
    rows = study("hold", "Spy", task={"seeds": [0, 7]}).rows
    assert len(rows) == 6 + 2 * 6  # hold draws no random numbers: one seed is enough
    assert not rows.duplicated(["dataset", "model", "fold", "seed", "run"]).any()
    assert sorted(rows[rows.model == "hold"]["run"]) == [f"r{i:02d}" for i in range(6)]
    assert (rows.status == "ok").all()


def test_a_model_never_sees_the_runs_it_is_scored_on(study):
    outcome = study(
        "Spy", runs=20
    )  # Spy itself asserts that no scored sample was in training, and tampers with its inputs
    assert outcome.failed == []
    for entry, summary in zip(log(study), outcome.summaries, strict=True):
        assert entry["train"] == summary["runs"]["train"]
        assert entry["valid"] == summary["runs"]["valid"]
        assert not set(entry["train"] + entry["valid"]) & set(summary["runs"]["test"])


def test_all_models_get_the_same_folds(study):
    study("Spy", "Together", runs=20)
    entries = log(study)
    assert entries[:3] == entries[3:]


def test_a_model_that_writes_into_its_inputs_does_not_change_the_truth(study):
    rows = study("Spy", "hold").rows
    data = study.sets["toy"]
    truth = read_truth(study.out, "toy", 0)
    np.testing.assert_array_equal(truth.truth[0], next(r for r in data.runs if r.id == truth.ids[0]).states[1:])
    assert rows["ed"].max() < 1e4


def test_the_folds_of_a_seed_train_together_where_the_class_can_and_share_the_time(study):
    outcome = study("Together", task={"seeds": [0, 1]})
    assert {s["fit_shared_by"] for s in outcome.summaries} == {3}
    assert (outcome.rows.groupby("seed")["fit_s"].nunique() == 1).all()


def test_diverged_runs_keep_a_row_with_the_time_and_no_score(study):
    rows = study("Explodes").rows
    first = rows[rows.fold == 0]
    assert first["status"].tolist() == ["diverged", "diverged"]
    assert first["reason"].iloc[0] == "u is inf at t = 5 s after the start"
    assert "from the true position (limit 100000 m) at t = 8 s" in first["reason"].iloc[1]
    assert first[["ed", "edh", "cvdm", "rmse_u", "ed_at_10s"]].isna().all(axis=None)


def test_a_failed_fit_gives_a_row_for_every_run_of_the_fold_and_stops_nothing(study):
    outcome = study("FailsToFit", "hold")
    rows = outcome.rows
    failed = rows[rows["model"].str.endswith("FailsToFit")]
    assert len(failed) == 6
    assert set(failed["status"]) == {"failed"}
    assert set(failed["reason"]) == {"fit: ZeroDivisionError: no data at all"}
    assert (rows[rows.model == "hold"]["status"] == "ok").all()
    assert len(outcome.failed) == 3


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "reason"),
    [("FailsToPredict", "predict: KeyError: 'u'"), ("ReturnsS0", "shape (2, 21, 10); accepted: (2, 20, 10)")],
)
def test_a_failed_or_misshapen_prediction_says_why(study, model, reason):
    rows = study(model).rows
    assert set(rows["status"]) == {"failed"}
    assert reason in rows["reason"].iloc[0]


def test_a_model_that_cannot_take_the_data_is_skipped_with_its_reason(study):
    outcome = study("NotForThis", "oracle")
    assert set(outcome.rows["status"]) == {"skipped"}
    assert "toy is too calm" in set(outcome.rows["reason"])
    assert any("not made by this simulator" in reason for reason in outcome.rows["reason"])
    assert outcome.failed == []


def test_every_metric_can_be_computed_again_from_what_is_saved(study):
    outcome = study("hold", "Explodes")
    for summary in outcome.summaries:
        rows = outcome.rows
        rows = rows[(rows.model == summary["model"]) & (rows.fold == summary["fold"])]
        for name, values in rescore(study.out, summary).items():
            np.testing.assert_allclose(values, rows[name], rtol=1e-12, err_msg=name)


def test_rows_agree_with_a_hand_computation_from_the_data(study):
    rows = study("Spy").rows
    row = rows.iloc[0]
    run = next(r for r in study.sets["toy"].runs if r.id == row["run"])
    distance = np.hypot(*(run.states[1:, :2] - run.states[0, :2]).T)
    assert row["ed"] == pytest.approx(distance.mean())
    assert row["ed_at_10s"] == pytest.approx(distance[9])
    assert row["final_displacement"] == pytest.approx(distance[-1])
    assert "ed_at_30s" not in rows  # beyond the horizon of 20 s


def test_a_summary_alone_identifies_its_experiment(study):
    summary = study("hold").summaries[0]
    data = study.sets["toy"]
    assert (summary["protocol"], summary["fingerprint"], summary["model"]) == (PROTOCOL, data.fingerprint, "hold")
    assert summary["task"]["horizon_s"] == 20
    assert {"shipbench", "source", "git"} <= set(summary["code"])
    assert {"cpus", "python", "torch", "numpy"} <= set(summary["machine"])
    assert {"params", "seed", "fold", "fit_s", "predict_s", "finished", "command"} <= set(summary)
    assert json.loads((study.out / "summary.json").read_text())[0] == json.loads(json.dumps(summary, default=str))


def test_resume_keeps_finished_cells_and_makes_the_missing_ones(study):
    before = study("Spy").rows
    cell = study.out / Cell("toy", f"{study.file}:Spy", 2, 0).folder
    (cell / "summary.json").unlink()
    after = study("Spy", resume=True).rows
    assert len(log(study)) == 3 + 1
    scores = ["fold", "run", "ed", "status"]
    pd.testing.assert_frame_equal(before[scores], after[scores])


@pytest.mark.long
@pytest.mark.parametrize("change", ["data", "file", "task"])
def test_resume_runs_again_what_other_data_code_or_task_made(study, change):
    study("Spy")
    if change == "file":
        study.file.write_text(MODELS + "\n# changed\n")
    study(
        "Spy", resume=True, task={"valid_runs": 2} if change == "task" else None, steps=21 if change == "data" else 20
    )
    assert len(log(study)) == 6


@pytest.mark.long
def test_without_resume_everything_is_run_again(study):
    study("Spy")
    study("Spy")
    assert len(log(study)) == 6
    assert not list(study.out.rglob("*.tmp*"))


def test_the_same_seed_gives_the_same_rows(study):
    first, second = (study("hold", out=out).rows for out in ("a", "b"))
    pd.testing.assert_frame_equal(
        first.drop(columns=["fit_s", "predict_s"]), second.drop(columns=["fit_s", "predict_s"])
    )


def test_fitted_models_are_saved_and_run_again_as_a_spec(study):
    outcome = study("hold")
    folder = study.out / outcome.summaries[0]["model"]
    saved = study.out / Cell("toy", "hold", 0, 0).folder / "model"
    assert saved.is_dir() and not folder.exists()  # noqa: PT018
    task = make_task({"dataset": "toy", "models": [str(saved)], "horizon_s": 20})
    again = run_tasks([task], study.out.parent / "again")
    np.testing.assert_allclose(again.rows.sort_values("run")["ed"], outcome.rows.sort_values("run")["ed"])


@pytest.mark.parametrize(
    ("models", "message"),
    [
        (["hld"], r"unknown predictor 'hld'. Did you mean 'hold'\?"),
        (["hold[size=3]"], r"'hold' has no parameter 'size'"),
        (["hold[size]"], r"parameter 'size' has no value"),
        (["none.py:Model"], r"none.py does not exist"),
    ],
)
def test_unknown_models_are_refused_before_anything_runs(toy, tmp_path, monkeypatch, models, message):
    monkeypatch.setattr("shipbench.bench.runner.load_dataset", lambda name: toy())
    with pytest.raises(InputError, match=message):
        run_tasks([make_task({"dataset": "toy", "models": ["hold", *models], "horizon_s": 20})], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_model_file_with_a_fault_is_named_in_one_message(toy, tmp_path, monkeypatch):
    monkeypatch.setattr("shipbench.bench.runner.load_dataset", lambda name: toy())
    (tmp_path / "bad.py").write_text("import nothing_of_that_name\n")
    with pytest.raises(
        InputError, match=r"bad\.py:Model' cannot be made: ModuleNotFoundError: No module named 'nothing_of_that_name'"
    ):
        run_tasks([make_task({"dataset": "toy", "models": [f"{tmp_path}/bad.py:Model"]})], tmp_path / "out")


def test_folders_without_results_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"holds no results.*shipbench run --out"):
        read_results([tmp_path])


def test_the_same_cell_in_two_folders_is_refused(study):
    study("hold", out="a")
    study("hold", out="b")
    with pytest.raises(InputError, match=r"'hold' on 'toy', fold 0, seed 0 stands in .*a and in .*b"):
        read_results([study.out.parent / "a", study.out.parent / "b"])


def test_the_time_of_fits_that_ran_together_is_said_to_be_a_share():
    summary = {"status": "ok", "run_status": ["ok"] * 4, "fit_s": 0.22, "fit_shared_by": 3}
    assert _outcome_text(summary) == "ok, 4 runs, fit 0.22 s (its share of 3 fits together)"
    assert _outcome_text(summary | {"fit_shared_by": 1}) == "ok, 4 runs, fit 0.22 s"
