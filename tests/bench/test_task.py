"""Tasks: what identifies an experiment, and what is refused."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from shipbench.bench.task import load_tasks, make_task, read_config, row_label
from shipbench.errors import InputError


def task(**changes):
    return make_task({"dataset": "toy", "models": ["hold"], **changes})


def test_one_config_gives_one_task_per_data_set(tmp_path):
    file = tmp_path / "two.toml"
    file.write_text('datasets = ["a", "b"]\nmodels = ["hold", "physics"]\nfolds = 3\n')
    tasks = load_tasks(file)
    assert [t.dataset for t in tasks] == ["a", "b"]
    assert all(t.folds == 3 and t.models == ("hold", "physics") for t in tasks)


def test_the_command_line_replaces_what_the_config_says(tmp_path):
    file = tmp_path / "c.toml"
    file.write_text('dataset = "a"\nmodels = ["physics"]\nfolds = 3\n')
    [changed] = load_tasks(file, {"models": ["hold"], "datasets": ["b"], "folds": None})
    assert (changed.dataset, changed.models, changed.folds) == ("b", ("hold",), 3)


def test_without_a_data_set_harbour90_is_meant():
    assert load_tasks(None, {"models": ["hold"]})[0].dataset == "harbour90"


def test_a_task_cannot_be_changed():
    with pytest.raises(ValidationError):
        task().folds = 7  # pyright: ignore[reportAttributeAccessIssue]


def test_names_given_twice_count_once():
    assert task(models=["hold", "physics", "hold"], seeds=[1, 1]).models == ("hold", "physics")


@pytest.mark.parametrize("name", ["paper", "smoke"])
def test_shipped_configs_are_found_by_name_and_valid(name):
    assert read_config(name)["models"]
    assert all(t.dataset.startswith("harbour90") for t in load_tasks(name))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('models = ["hold"]\nhorizn_s = 60', r"unknown key 'horizn_s'. Did you mean 'horizon_s'\?"),
        ('models = ["hold"]\nhorizon_s = -1', r"horizon_s: .*greater than 0.*\(value: -1\)"),
        ('models = ["hold"]\nfolds = 1', r"folds: .*\(value: 1\)"),
        ('models = ["hold"]\nsplit = "random"', r"split: .*'folds', 'published', 'kind', 'speed' or 'extrapolate'"),
        ('models = ["hold"]\nmetrics = ["ed", "edx"]', r"unknown metric 'edx'. Did you mean 'ed"),
        ('models = ["hold"]\nmetrics = ["edh"]', r"'ed' must be among the metrics"),
        ('dataset = "a"\ndatasets = ["b"]\nmodels = ["hold"]', r"both 'dataset' and 'datasets'"),
        ('datasets = "b"\nmodels = ["hold"]', r"datasets = 'b'; accepted: a list"),
        ("folds = 5", r"no model is given"),
        ('models = ["hold"]\nhorizon_s = true', r"horizon_s: .*not true or false \(value: True\)"),
        ('models = ["hold"]\nhorizon_s = "60"', r"horizon_s: .*not text \(value: 60\)"),
        ('models = ["hold"]\nhorizon_s = inf', r"horizon_s: .*finite number"),
        ('models = ["hold"]\nstride_s = nan', r"stride_s: .*finite number"),
        ('models = ["hold"]\nfolds = "5"', r"folds: .*not text"),
        ('models = ["hold"]\nfolds = true', r"folds: .*not true or false"),
        ('models = ["hold"]\nseeds = [0, "1"]', r"seeds.1: .*not text"),
        ('models = ["hold"]\nseeds = [-1]', r"seeds.0: .*\(value: -1\)"),
        ('models = ["hold"]\nfold_seed = 5000000000', r"fold_seed: .*\(value: 5000000000\)"),
        ('models = "hold"', r"models: .*\(value: hold\)"),
        ('models = ["hold"]\ntitle = 3', r"title: .*string"),
        ("models = []", r"no model is given"),
        ("models = [", r"is not valid TOML"),
    ],
)
def test_a_wrong_config_says_which_key_and_what_is_accepted(tmp_path, text, message):
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        load_tasks(file)


def test_a_missing_config_names_its_path(tmp_path):
    with pytest.raises(InputError, match=r"cannot read .*none\.toml: No such file"):
        load_tasks(tmp_path / "none.toml")


def test_a_horizon_between_two_samples_is_refused():
    assert task(horizon_s=60.0).steps(0.1) == 600
    with pytest.raises(InputError, match="not a whole number"):
        task(horizon_s=1e308).steps(0.1)
    with pytest.raises(InputError, match=r"horizon_s = 60\.5 s is not a whole number of samples of 1 s"):
        task(horizon_s=60.5).steps(1.0)


def test_the_key_tells_tasks_apart_by_what_changes_a_score_only():
    key = task().key("data")
    assert task(models=["physics"], seeds=[3], title="x", metrics=["ed"]).key("data") == key
    assert task(dataset="the same data elsewhere").key("data") == key
    assert (
        len(
            {
                key,
                task(folds=3).key("data"),
                task(horizon_s=60).key("data"),
                task(fold_seed=1).key("data"),
                task().key("other"),
            }
        )
        == 5
    )


def test_a_task_without_the_newer_keys_keeps_its_key():
    """Rows from before `train_runs` must stay rankable: the key of the paper's task is the one in the committed
    rows."""
    assert load_tasks("paper")[0].key("e102babe79cc29d8") == "ea05ddf8a550"
    assert task(train_runs=8).key("data") != task().key("data")
    assert task(train_on=["measured"]).key("data") == task().key("data")
    paired = task(simulated="twin")
    assert paired.key("data", "a") == task(simulated="elsewhere", train_on=["simulated"]).key("data", "a")
    assert len({paired.key("data", "a"), paired.key("data", "b"), task().key("data")}) == 3
    assert len({task(split=s).key("data") for s in ("folds", "published", "kind", "speed", "extrapolate")}) == 5


def test_models_are_trained_on_all_three_where_simulated_runs_are_given():
    assert task().train_on == ("measured",)
    assert task(simulated="twin").train_on == ("measured", "simulated", "simulated+measured")
    assert task(simulated="twin", train_on=["simulated", "simulated"]).train_on == ("simulated",)
    assert [row_label("mlp", choice) for choice in ("measured", "simulated")] == ["mlp", "mlp (simulated)"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"train_on": ["simulated"]},
            "train_on: no simulated runs are given; add simulated=FOLDER, made by",
        ),
        ({"train_on": ["both"], "simulated": "twin"}, "'measured', 'simulated' or 'simulated\\+measured'"),
        ({"bands": True, "simulated": "twin"}, "train_on: bands are computed for models trained on measured runs only"),
        ({"models": ["a", "a (simulated)"], "simulated": "twin"}, "two rows would be named 'a \\(simulated\\)'"),
        ({"models": ["a" * 995], "simulated": "twin"}, "has 1007 characters; accepted: at most 1000"),
    ],
)
def test_choices_of_training_runs_that_cannot_be_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        task(**changes)
