"""`--device`: what is accepted, who gets it, and that every tensor of a network is where it belongs (`fake_gpu.py`:
without a GPU)."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from shipbench.bench.executors import Execution
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.bench.work import FoldData, Job, work
from shipbench.cli.app import app
from shipbench.contract.check import check_model
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor, parse_spec
from shipbench.predictors.device import check_device

NETWORKS = ("mlp", "lstm", "neural_ode")


@pytest.fixture
def gpu(monkeypatch):
    """As if PyTorch found one GPU."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)


@pytest.mark.long
@pytest.mark.parametrize("name", NETWORKS)
def test_every_tensor_of_training_and_prediction_is_on_the_device(name):
    done = subprocess.run(
        [sys.executable, Path(__file__).with_name("fake_gpu.py"), name], capture_output=True, text=True, check=False
    )
    assert done.stdout == "all on gpu:0\n", done.stderr[-2000:]


@pytest.mark.parametrize("name", ["foo", "cuda:", "cuda:-1", "CUDA", "", "mps", 7, None])
def test_an_unknown_device_is_refused_with_what_is_accepted(name):
    with pytest.raises(InputError, match=r"is unknown. Accepted: cpu, cuda \(the first GPU\), cuda:1"):
        check_device(name)


def test_a_device_that_is_not_here_is_refused(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(InputError, match=r"'cuda' is not here: .* finds no GPU. Accepted here: cpu\."):
        check_device("cuda")
    assert check_device("cuda", here=False) == "cuda"
    assert check_device("cpu") == "cpu"


def test_a_second_gpu_is_refused_where_there_is_one(gpu):
    assert check_device("cuda") == "cuda"
    assert check_device("cuda:0") == "cuda:0"
    with pytest.raises(InputError, match=r"'cuda:1' is not here: .* finds 1 GPU. Accepted here: cpu, cuda:0\."):
        check_device("cuda:1")


@pytest.mark.parametrize("name", NETWORKS)
def test_the_spec_goes_before_the_option(name, gpu):
    assert make_predictor(parse_spec(name)).device == "cpu"
    assert make_predictor(parse_spec(name), "cuda").device == "cuda"
    assert make_predictor(parse_spec(f"{name}[device=cpu]"), "cuda").device == "cpu"
    assert make_predictor(parse_spec(f"{name}[device=cuda]")).device == "cuda"


def test_models_without_a_device_take_no_notice_of_it(gpu):
    assert not hasattr(make_predictor(parse_spec("physics"), "cuda"), "device")


def test_a_model_saved_on_one_device_loads_on_another(harbour, tmp_path, monkeypatch):
    model = make_predictor(parse_spec("mlp[epochs=1]")).fit(harbour.subset(range(8)), harbour.subset(range(8, 12)))
    batch = harbour.subset(range(12, 16)).batch()
    S = model.predict(batch.s0, batch.U)
    model.device = "cuda"
    model.save(tmp_path / "model")
    assert json.loads((tmp_path / "model" / "model.json").read_text())["params"]["device"] == "cuda"
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    loaded = make_predictor(parse_spec(str(tmp_path / "model")))
    assert loaded.device == "cpu"
    np.testing.assert_array_equal(loaded.predict(batch.s0, batch.U), S)
    with pytest.raises(InputError, match="'cuda' is not here"):
        make_predictor(parse_spec(str(tmp_path / "model")), "cuda")


@pytest.mark.parametrize(
    "command", ["run --model hold", "learning-curve --model hold", "check hold", "predict MODEL harbour90"]
)
def test_a_bad_device_ends_a_command_with_exit_code_2(command, tmp_path, monkeypatch, harbour):
    monkeypatch.chdir(tmp_path)
    make_predictor(parse_spec("hold")).fit(harbour).save("MODEL")
    found = CliRunner().invoke(app, [*command.split(), "--device", "foo"])
    assert (found.exit_code, found.stdout) == (2, "")
    assert found.stderr == "error: device 'foo' is unknown. Accepted: cpu, cuda (the first GPU), cuda:1 (the second).\n"


def test_a_study_takes_the_device_and_says_so(tmp_path):
    task = make_task(
        {"dataset": "harbour90", "models": ["mlp[epochs=1]", "hold"], "max_runs": 6, "horizon_s": 20, "folds": 2}
    )
    outcome = run_tasks([task], tmp_path / "out", execution=Execution(device="cpu"))
    assert not outcome.failed
    assert outcome.summaries[0]["params"]["device"] == "cpu"
    assert json.loads((tmp_path / "out" / "study.json").read_text())["execution"]["device"] == "cpu"


def test_the_device_reaches_the_worker(harbour, gpu):
    answers = work(
        Job(parse_spec("mlp[epochs=1]"), 0, {}, device="cuda:1"), [FoldData(harbour, None, *_asked(harbour))]
    )
    assert answers[0].status == "failed"
    assert "'cuda:1' is not here" in answers[0].reason


def _asked(data):
    batch = data.batch()
    return batch.s0, batch.U, None


def test_the_contract_is_checked_on_a_device():
    report = check_model("mlp[epochs=1]", device="cpu")
    assert not report.of("broken")
    with pytest.raises(InputError, match="unknown"):
        check_model("hold", device="foo")
