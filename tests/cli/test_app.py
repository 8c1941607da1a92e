"""The command line: what it prints and writes, exit codes, and one message without a traceback for bad input."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from shipbench.cli.app import app

QUICK = ("--horizon", "20", "--folds", "2")


@pytest.fixture
def cli(tmp_path, monkeypatch, undrawn):
    """Runs shipbench in an empty folder: `cli("run", ...)` gives the result with exit_code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def test_version(cli):
    assert cli("--version").stdout.strip() == f"shipbench {version('shipbench')}"


def test_python_m_is_the_same_command():
    done = subprocess.run([sys.executable, "-m", "shipbench", "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, f"shipbench {version('shipbench')}")


@pytest.mark.parametrize("arguments", [["effects"], ["effects", "--json"], ["models"]])
def test_a_reader_that_has_read_enough_is_no_error(arguments):
    reader, writer = os.pipe()
    os.close(reader)  # as `| head` does, sooner
    done = subprocess.run(
        [sys.executable, "-m", "shipbench", *arguments], stdout=writer, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.parametrize("command", ["run", "leaderboard", "models", "validate", "predict", "data"])
def test_every_command_has_help(cli, command):
    result = cli(command, "-h")
    assert result.exit_code == 0
    assert "Usage: " in result.stdout


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from shipbench.cli.app import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('torch', 'casadi', 'matplotlib', 'pandas', 'numpy', 'lightning') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_run_prints_and_writes_the_leaderboard(cli, toy_folder, tmp_path, undrawn):
    undrawn.undo()
    result = cli("run", "--model", "hold", "--dataset", toy_folder(), *QUICK)
    assert result.exit_code == 0, result.output
    assert "ED μ" in result.stdout
    assert "[2/2] toyset hold fold 1 seed 0: ok" in result.stderr
    page = (tmp_path / "runs/toyset/toyset.md").read_text()
    assert f"Made by `shipbench run --model hold --dataset {tmp_path}/toyset --horizon 20 --folds 2`" in page
    for image in ("tracks", "errors", "error-against-horizon"):
        assert f"(toyset/{image}.png)" in page
        assert (tmp_path / f"runs/toyset/toyset/{image}.png").is_file()
    rows = pd.read_parquet(tmp_path / "runs/toyset/rows.parquet")
    assert len(rows) == 12  # 6 runs of 40 s: two windows each
    assert set(rows["status"]) == {"ok"}


def test_json_is_one_document_and_nothing_else(cli, toy_folder):
    result = cli("run", "-m", "hold", "-d", toy_folder(), *QUICK, "-q", "--json")
    document = json.loads(result.stdout)
    assert result.stderr == ""
    assert document["leaderboards"]["toyset"]["ranking"] == ["hold"]
    assert document["failed"] == []


def test_quiet_keeps_the_result_and_what_was_written(cli, toy_folder):
    result = cli("run", "-m", "hold", "-d", toy_folder(), *QUICK, "-q")
    assert result.stderr == ""
    assert {"ED", "μ", "[m]"} <= set(result.stdout.split())
    assert "Leaderboard: runs/toyset/toyset.md" in result.stdout


def test_only_the_equations_of_this_study_are_counted(cli, toy_folder):
    arguments = ("-d", toy_folder(), *QUICK, "--out", "r")
    cli("run", "-m", "physics", "-m", "physics+current", *arguments)
    assert (
        "Fitted equations of 1 model, for example:\n  r/cells/toyset/physics/fold0"
        in cli("run", "-m", "physics", *arguments, "--resume").stdout
    )
    assert "Fitted equations" not in cli("run", "-m", "hold", *arguments, "--resume").stdout


def test_half_of_a_model_file_is_answered_with_the_whole(cli, toy_folder, tmp_path):
    (tmp_path / "mine.py").write_text(
        "raise RuntimeError('imported')\nclass Helper: pass\nclass Mine:\n    def fit(self): pass\n"
        "    def predict(self): pass\n"
    )
    folder = toy_folder()
    for given, lacks in (
        ("mine.py", "a file without its class"),
        ("mine.py[gain=2]", "a file without"),
        ("Mine", "a class without its file"),
    ):
        result = cli("run", "-m", given, "-d", folder, *QUICK, "-q")
        assert result.exit_code == 2
        assert f"names {lacks}" in result.stderr
        assert "Give mine.py:Mine." in result.stderr


def test_resume_keeps_what_is_finished(cli, toy_folder):
    arguments = ("run", "-m", "hold", "-d", toy_folder(), *QUICK, "--out", "r")
    cli(*arguments)
    assert "ok (kept)" in cli(*arguments, "--resume").stderr
    assert "(kept)" not in cli(*arguments).stderr


def test_commands_that_pages_suggest_one_after_another_stand_beside_each_other(cli, toy_folder, tmp_path):
    """The second had been refused, or had replaced the first: without --out both went into the folder of the data
    set."""
    folder = toy_folder()
    name = folder.name
    first, second = (
        ("run", "-m", "hold", "-d", folder, *QUICK),
        ("run", "-m", "hold", "-m", "physics[iterations=2]", "-d", folder, *QUICK),
    )
    assert f"Results: runs/{name}\n" in cli(*first).stdout
    assert f"Results: runs/{name}-2\n" in cli(*second).stdout
    assert f"Results: runs/{name}\n" in cli(*first).stdout  # the same study again
    resumed = cli(*second, "--resume")
    assert f"Results: runs/{name}-2\n" in resumed.stdout
    assert "ok (kept)" in resumed.stderr


def test_a_users_own_class_runs_and_its_failure_is_exit_code_one(cli, toy_folder, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n"
        "class Mine:\n"
        "    def fit(self, train, valid=None, *, seed=0): return self\n"
        "    def predict(self, s0, U, history=None): return np.repeat(s0[:, None], U.shape[1], axis=1)\n"
        "class Broken(Mine):\n"
        "    def predict(self, s0, U, history=None): raise RuntimeError('boom')\n"
    )
    folder = toy_folder()
    assert cli("run", "-m", "mine.py:Mine", "-d", folder, *QUICK, "-q").exit_code == 0
    result = cli("run", "-m", "hold", "-m", "mine.py:Broken", "-d", folder, *QUICK, "-q", "--out", "r")
    assert result.exit_code == 1
    assert "2 of 4 fits failed:" in result.stderr
    assert "toyset mine.py:Broken fold 0 seed 0: predict: RuntimeError: boom" in result.stderr


def test_leaderboard_renders_from_saved_results_only(cli, toy_folder, tmp_path, undrawn):
    folder = toy_folder()
    cli("run", "-m", "hold", "-d", folder, *QUICK, "-q", "--out", "runs/a")
    undrawn.undo()
    shutil.rmtree(folder)
    result = cli("leaderboard")
    assert result.exit_code == 0, result.output
    assert "Rendered by `shipbench leaderboard`" in (tmp_path / "leaderboards/toyset.md").read_text()
    assert (tmp_path / "leaderboards/toyset/tracks.png").is_file()


def test_a_leaderboard_draws_through_no_link(cli, toy_folder, tmp_path):
    cli("run", "-m", "hold", "-d", toy_folder(), *QUICK, "-q", "--out", "runs/a")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages/toyset").symlink_to(tmp_path / "elsewhere")
    result = cli("leaderboard", "runs/a", "--out", "pages")
    assert result.exit_code == 2
    assert "pages/toyset is a link; accepted: a folder" in result.stderr
    assert not list((tmp_path / "elsewhere").iterdir())


def test_rows_of_different_data_are_refused_on_the_command_line(cli, toy_folder):
    cli("run", "-m", "hold", "-d", toy_folder(), *QUICK, "-q", "--out", "runs/a")
    cli("run", "-m", "hold[seed=1]", "-d", "toyset", *QUICK, "-q", "--out", "runs/b", "--max-runs", "4")
    result = cli("leaderboard", "runs/a", "runs/b")
    assert result.exit_code == 2
    assert "never ranked together" in result.stderr


def test_predict_writes_the_states_of_a_saved_model(cli, toy_folder, tmp_path):
    folder = toy_folder()
    cli("run", "-m", "hold", "-d", folder, *QUICK, "-q", "--out", "r")
    result = cli("predict", "r/cells/toyset/hold/fold0-seed0/model", folder, "--out", "p.csv", "--horizon", "30")
    assert result.exit_code == 0, result.output
    table = pd.read_csv(tmp_path / "p.csv")
    assert list(table.columns[:4]) == ["trajectory", "t", "x", "y"]
    assert len(table) == 6 * 31
    result = cli("predict", "r/cells/toyset/hold/fold0-seed0/model", folder, "--out", "p.csv", "--horizon", "30.4")
    assert result.exit_code == 2
    assert "--horizon = 30.4 s is not a whole number of samples of" in result.stderr
    start = pd.read_csv(folder / "trajectories.csv").query("trajectory == 'r03' and t == 0").iloc[0]
    assert table.query("trajectory == 'r03' and t == 0").iloc[0]["psi"] == pytest.approx(start["psi"], rel=1e-6)


def test_predict_writes_limits_of_a_model_that_was_saved_with_a_band(cli, toy_folder, tmp_path, undrawn):
    folder = toy_folder(runs=20, steps=30)
    cli("run", "-m", "hold", "-d", folder, *QUICK, "--bands", "-q", "--out", "r")
    result = cli("predict", "r/cells/toyset/hold/fold0-seed0/model", folder, "--out", "p.csv")
    assert result.stdout.startswith("Written: p.csv (20 runs)\nLimits: x_low to r_high over the first 20 s.")
    assert " ".join(result.stdout.split()).endswith("was fitted on 9 of the 20 runs: there they can be too wide.")
    table = pd.read_csv(tmp_path / "p.csv")
    assert (table["x_low"] < table["x_high"])[table["t"].between(1, 20)].all()


def test_no_command_writes_its_file_over_what_it_reads(cli, toy_folder, tmp_path):
    folder = toy_folder()
    cli("run", "-m", "hold", "-d", folder, *QUICK, "-q", "--out", "r")
    model, log = Path("r/cells/toyset/hold/fold0-seed0/model"), folder / "trajectories.csv"
    for command, read in (
        (["predict", model, folder, "--out", log], log),
        (["predict", model, folder, "--out", model / "model.json"], tmp_path / model / "model.json"),
        (["report", "r", "--out", "r/rows.parquet"], tmp_path / "r/rows.parquet"),
        (["data", "import", log, "--propose", log, "--force"], log),
    ):
        before = read.read_bytes()
        result = cli(*command)
        assert result.exit_code == 2, command
        assert "it would be overwritten" in result.stderr
        assert read.read_bytes() == before


def test_a_diagnosis_that_cannot_be_written_is_told_before_anything_is_fitted(cli, toy_folder, tmp_path, monkeypatch):
    monkeypatch.setattr("shipbench.diagnosis.diagnose.diagnose", lambda *_, **__: pytest.fail("fitted"))
    (tmp_path / "f").write_text("mine")
    result = cli("diagnose", toy_folder(), "--out", "f")
    assert result.exit_code == 2
    assert "--out f cannot be made: it is a file; accepted: a folder." in result.stderr


def test_a_twin_is_simulated_and_models_are_trained_on_it(cli, toy_folder):
    toy_folder()
    made = cli("data", "simulate", "hold", "--like", "toyset")
    written, hint = made.stdout.splitlines()
    assert written.startswith("Written: toyset-simulated (6 runs, ")
    assert hint == "Train on it: shipbench run -m mlp --dataset toyset --simulated toyset-simulated"
    spec = "physics[iterations=0]"
    result = cli("run", "-m", spec, "-d", "toyset", "--simulated", "toyset-simulated", *QUICK, "--json", "--train-on",
                 "simulated, simulated+measured")  # fmt: skip
    assert result.exit_code == 0, result.output
    [board] = json.loads(result.stdout)["leaderboards"].values()
    assert sorted(board["ranking"]) == [f"{spec} (simulated)", f"{spec} (simulated+measured)"]


def test_models_lists_names_and_parameters(cli):
    parts = {p["name"]: p for p in json.loads(cli("models", "--json").stdout)}
    assert {"hold", "physics", "mlp", "lstm", "oracle"} <= set(parts)
    assert parts["mlp"]["parameters"]["hidden"] == "100"
    assert parts["hold"]["parameters"] == {}
    assert "mlp" in cli("models").stdout


def test_data_commands_find_what_is_there(cli, toy_folder):
    assert {d["name"] for d in json.loads(cli("data", "list", "--json").stdout)} >= {"harbour90", "harbour90_noisy"}
    facts = json.loads(cli("data", "check", toy_folder(), "--json").stdout)
    assert facts["runs"] == "6 in 6 groups, 246 samples at 1 s, 40 s long"
    assert any("propeller not given" in note for note in facts["note"])
    table = json.loads(cli("data", "describe", "toyset", "--json").stdout)["statistics"]
    assert {row["signal"]: row["unit"] for row in table["rows"]}["delta"] == "deg"


def test_data_make_writes_a_folder_that_loads_as_the_same_data(cli, tmp_path):
    made = cli("data", "make", "harbour90", "--out", "mine")
    assert made.exit_code == 0, made.output
    fingerprint = json.loads(cli("data", "check", "mine", "--json").stdout)["fingerprint"]
    assert fingerprint in made.stdout
    tables = json.loads(cli("data", "describe", "mine", "--json").stdout)
    assert [tables[key]["title"] for key in ("table_ii", "against_the_paper")] == [
        "The paper's Table II",
        "Here against the paper",
    ]


def test_validate_prints_every_row_and_fails_when_one_is_outside(cli, monkeypatch):
    row = {
        "ship": "s",
        "quantity": "q",
        "computed": 1.0,
        "published": 1.1,
        "unit": "m",
        "tolerance": "5 %",
        "source": "x",
    }
    monkeypatch.setattr("shipbench.simulate.validation.table", lambda: [row | {"passed": None}, row | {"passed": True}])
    good = cli("validate")
    assert good.exit_code == 0
    assert "passed" in good.stdout
    monkeypatch.setattr("shipbench.simulate.validation.table", lambda: [row | {"passed": False}])
    assert cli("validate").exit_code == 1
    assert json.loads(cli("validate", "--json").stdout)[0]["passed"] is False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "-m", "hld", "-d", "toyset"], r"unknown predictor 'hld'. Did you mean 'hold'?"),
        (["run", "-m", "hold[size=2]", "-d", "toyset"], r"'hold' has no parameter 'size'"),
        (["run", "-m", "hold", "-d", "harbor90"], r"'harbor90'. Did you mean 'harbour90'?"),
        (
            ["run", "-m", "hold", "-d", "toyset", "--horizon", "500"],
            "the longest run 'r00' has 41. Shorten the horizon",
        ),
        (["run", "-m", "hold", "-d", "toyset", "--horizon", "20", "--folds", "7"], "has 6 runs; give at most 6 folds"),
        (
            ["run", "-m", "hold", "-d", "toyset", "--folds", "1"],
            "folds: Input should be greater than or equal to 2 (value: 1)",
        ),
        (["run", "-m", "hold", "-d", "toyset", "--seeds", "a,b"], "--seeds a,b: not a list of whole numbers"),
        (["run", "-d", "toyset"], "no model is given; name at least one (--model physics)"),
        (["run", "-m", "hold", "--config", "none.toml"], "cannot read none.toml: No such file or directory"),
        (["run", "-m", "hold", "--config", "wrong.toml"], "unknown key 'fold'. Did you mean 'folds'?"),
        (["run", "-m", "hold", "--config", "binary.toml"], "binary.toml is not UTF-8 text"),
        (
            ["run", "-m", "hold", "-d", "toyset", "--horizon", "20", "--out", "wrong.toml/x"],
            "cannot write to wrong.toml/x: Not a directory",
        ),
        (
            ["run", "-m", "hold", "-d", "toyset", "--horizon", "20", "--simulated", "toyset"],
            "is no twin of data set 'toyset': its states are the measured ones",
        ),
        (["run", "-m", "hold", "-d", "toyset", "--train-on", "simulated"], "add --simulated FOLDER"),
        (["data", "simulate", "calibrated", "--like", "toyset"], "'calibrated' must be fitted before it can simulate"),
        (["data", "simulate", "hold", "--like", "toyset", "--out", "toyset"], "holds the data set 'toyset'"),
        (["leaderboard"], "no results below runs/"),
        (["leaderboard", "toyset"], "toyset holds no results"),
        (["predict", "hold", "toyset"], "'hold' is not a saved model"),
        (["data", "check", "nothing"], "unknown folder or data set 'nothing'"),
        (["data", "make", "harbour9"], "Did you mean 'harbour90'?"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_two(cli, toy_folder, tmp_path, arguments, message):
    toy_folder()
    (tmp_path / "wrong.toml").write_text("fold = 3\n")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    result = cli(*arguments)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("fault", "message"),
    [({"drop": "psi"}, "psi"), ({"spoil": (5, "u", "")}, "u"), ({"spoil": (5, "r", "fast")}, "r")],
)
def test_a_faulty_table_is_named(cli, toy_folder, fault, message):
    result = cli("run", "-m", "hold", "-d", toy_folder(**fault), *QUICK)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert "Traceback" not in result.output


@pytest.mark.parametrize("arguments", [["run", "--foo"], ["nothing"], ["predict"], ["run", "--folds", "x"]])
def test_wrong_use_of_a_command_is_exit_code_two(cli, arguments):
    result = cli(*arguments)
    assert result.exit_code == 2
    assert "Usage" in result.stderr


def test_the_installed_command_says_bad_input_without_a_traceback(tmp_path):
    command = Path(sys.executable).with_name("shipbench")
    done = subprocess.run(
        [command, "run", "-m", "hold", "-d", "nothing"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: unknown folder or data set 'nothing'")
    assert done.stderr.count("\n") == 1
