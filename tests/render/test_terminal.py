"""The terminal: at 80, 100 and 120 columns no line is too long, no name and no number is cut; what is said first; what
-q keeps."""

from __future__ import annotations

import io
import json
import os
import shlex
from pathlib import Path

import pytest
from rich.console import Console
from scipy.io import savemat
from toy_ship import write_toy_folder
from typer.testing import CliRunner

from shipbench.bench import progress
from shipbench.bench.submissions import read_results
from shipbench.cli.app import app
from shipbench.diagnosis.result import Cause, Diagnosis, Estimate
from shipbench.leaderboard.board import Board
from shipbench.leaderboard.pages import build_board
from shipbench.render.table import Table, TableColumn, number
from shipbench.render.terminal import command_lines, show_table
from shipbench.reports.diagnosis.summary import summary_lines
from shipbench.steps import listening, step, tick, within

WIDTHS = [80, 100, 120]
MODELS = ("hold", "hold[seed=1]", "physics[iterations=2,tolerance=0.001,piece=10.0]")
QUICK = ("--horizon", "10", "--folds", "2")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a data set `toyset` and the results `r` of three models, one of which has a long name."""
    place = tmp_path_factory.mktemp("terminal")
    write_toy_folder(place / "toyset", 4, 20)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        patch.setattr("shipbench.leaderboard.plots.draw_all", lambda *_: [])
        options = [part for model in MODELS for part in ("-m", model)]
        done = CliRunner().invoke(app, ["run", *options, "-d", "./toyset", *QUICK, "-o", "r", "-q"])
    assert done.exit_code == 0, done.output
    return place


@pytest.fixture
def cli(folder, monkeypatch):
    monkeypatch.chdir(folder)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def board(folder) -> Board:
    return build_board(read_results([folder / "r"]), "toyset")


def fits(text: str, width: int) -> None:
    assert [line for line in text.splitlines() if len(line) > width] == []


def whole(table: Table, text: str) -> None:
    """Every cell of the table stands in the text as it is."""
    words = set(text.split())
    for row in table.rows:
        for column in table.columns:
            assert set(column.text(row).split()) <= words, (column.header, column.text(row))


@pytest.mark.parametrize("width", WIDTHS)
def test_a_leaderboard_begins_with_a_sentence_and_cuts_neither_names_nor_numbers(cli, board, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    short, full = (cli("leaderboard", "r", "--no-plots", "-o", "pages", *option).stdout for option in ((), ("--full",)))
    assert " ".join(short.split()).startswith(
        f"Leaderboard: toyset '{board.ranking[0]}' is first: mean position error (ED) "
    )
    assert len(short.splitlines()) < 35 < len(full.splitlines())
    assert board.short is not None
    for text, tables in ((short, [board.short]), (full, board.tables)):
        fits(text, width)
        for table in tables:
            whole(table, text)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    "command",
    ["run -m hold -d ./toyset --horizon 10 --folds 2 -o again", "data check ./toyset --full",
        "data describe ./toyset --full", "data list", "models",
     "models mlp", "effects", "effects current", "validate", "check hold", "--help", "run --help", "data import --help",
     "diagnose --help"],
)  # fmt: skip
def test_no_line_of_a_command_is_too_long(cli, monkeypatch, command, width):
    if command == "validate":  # simulates for seconds
        row = {
            "ship": "kvlcc2_l7",
            "quantity": "tactical diameter, +35 deg",
            "computed": 3.347,
            "published": 3.36,
            "unit": "L",
            "tolerance": "3 %",
        }
        monkeypatch.setattr(
            "shipbench.simulate.validation.table",
            lambda: [row | {"passed": True, "source": "Yasukawa and Yoshimura, 2015, " * 3}],
        )
    if width != WIDTHS[0] and command.startswith(("run -m", "check", "data describe")):
        pytest.skip("slow; its tables are the same at every width")
    monkeypatch.setenv("COLUMNS", str(width))
    done = cli(*command.split())
    assert done.exit_code == 0, done.output
    fits(done.stdout, width)


def test_a_name_of_any_length_and_every_figure_are_whole():
    name = "path/to/a/folder/model.py:ClassWithParameters[hidden=64,layers=3]"
    figures = [f"f{i}" for i in range(9)]
    row: dict = {"model": name}
    for f in figures:
        row |= {f: 1234.5, f"{f}_low": 1000.25, f"{f}_high": 2000.75}
    columns = [
        TableColumn("model", "model"),
        *[TableColumn(f"figure of {f} [m]", f, number(2), interval=f < "f7") for f in figures],
    ]
    table, stream = Table("Title", columns, [row, row | {"model": "hold"}]), io.StringIO()
    show_table(table, Console(file=stream, width=80))
    fits(stream.getvalue(), 80)
    whole(table, stream.getvalue())
    assert name in stream.getvalue().splitlines()  # on a line of its own


def test_a_table_of_words_that_does_not_fit_becomes_a_list():
    stream = io.StringIO()
    columns = [TableColumn("what", "a"), TableColumn("why", "b"), TableColumn("then", "c")]
    show_table(
        Table("Title", columns, [{"a": "one", "b": "long words " * 9, "c": "short"}]), Console(file=stream, width=80)
    )
    fits(stream.getvalue(), 80)
    assert stream.getvalue().splitlines()[1:3] == ["one", "  why: " + ("long words " * 6).strip() + " long"]


def test_a_diagnosis_is_short_unless_all_is_asked_for_and_its_command_can_be_pasted():
    sizes = {"speed": Estimate(0.31, "m/s", (0.28, 0.34))}
    causes = tuple(
        Cause(f"current_per_run_{i}", i, 44.0, 0.01, sizes, "12 of 12 runs support it", (), None) for i in range(3)
    )
    found = Diagnosis("toy", "found", causes, (), (), {}, "physics+current", "0", 1.0)
    for width in WIDTHS:
        for full in (False, True):
            fits("\n".join(summary_lines(found, width, full)), width)
    assert "--full" in summary_lines(found, 80, full=False)[-1]
    command = (
        "shipbench run --model physics --model 'physics+current[speed=0.3]' --dataset 'my trial' --horizon 60 --folds 5"
    )
    lines = command_lines(command, 80)
    assert len(lines) > 1
    assert shlex.split("\n".join(lines).replace("\\\n", "")) == shlex.split(command)


def test_quiet_keeps_the_result_and_what_was_written(cli):
    for line in ("leaderboard r --no-plots -o pages", "data check ./toyset", "data export ./toyset -o out.mat"):
        arguments = line.split()
        quiet = cli(*arguments, "-q")
        assert quiet.stderr == ""
        assert quiet.stdout.strip() == cli(*arguments).stdout.strip() != ""


@pytest.mark.parametrize(
    "command",
    ["diagnose {}", "data check {}", "data describe {}", "data export {} -o x", "data make {}", "run -m hold -d {}",
        "check hold -d {}",
                "predict model {}", "learning-curve -m hold -d {}"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["bridge.csv", "my log.xlsx", "bridge.mat"])
def test_a_log_where_a_data_set_is_asked_for_is_answered_with_the_import_command(cli, folder, command, name):
    (folder / name).write_text("t,x\n0,1\n")
    if name.endswith(".mat"):
        savemat(folder / name, {"speed": [1.0, 2.0]})
    done = cli(*[part.format(name) for part in command.split()])
    assert done.exit_code == 2
    expected = (
        f"error: '{name}' is a log, not a data set yet. Start with: shipbench data import "
        f"{shlex.quote(name)} --propose mapping.toml\n"
    )
    assert done.stderr == expected


def test_a_file_of_a_data_set_is_answered_with_its_folder(cli):
    assert "Give toyset." in cli("diagnose", "toyset/trajectories.csv").stderr


def test_effects_and_models_explain_one(cli):
    said = cli("effects", "rudder_offset").stdout
    assert "deg" in said
    assert "Trial that separates it: " in said
    assert "Source: " in said
    assert "shipbench run --model physics --model physics+rudder_offset" in said
    said = cli("models", "mlp").stdout
    assert "hidden=100" in said
    assert "shipbench run --model mlp" in said
    assert json.loads(cli("effects", "current", "--json").stdout)["separate"]
    assert "Did you mean 'mlp'?" in cli("models", "mpl").stderr
    assert cli("effects", "curent").exit_code == 2


def test_help_has_groups_and_completion(cli):
    said = cli("--help").stdout
    for title in ("Your data:", "Models:", "Results:", "For developers:"):
        assert f"\n{title}\n" in said
    assert "More:" not in said  # every command has its group
    assert "--install-completion" in said
    assert "--show-completion" in said
    assert "..." not in said.split("Your data:")[1]


def test_steps_are_told_to_who_listens_and_cost_nothing_else(monkeypatch):
    step("nobody listens", 0.0, 1.0)
    told: list[tuple[str, float]] = []
    with listening(lambda what, share: told.append((what, round(share, 3)))):
        step("first", 0.0, 0.5)
        within(0.5)
        step("second", 0.5, 1.0)
        tick(2)
        tick(2)
    within(0.9)
    assert told == [("first", 0.0), ("first", 0.25), ("second", 0.5), ("second", 0.75), ("second", 0.875)]


def test_a_plain_line_comes_each_ten_seconds_with_the_remaining_time(monkeypatch):
    clock = iter([0.0, 9.0, 12.0, 20.0, 24.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    stream = io.StringIO()
    lines = progress.StepLines(stream)
    for share in (0.1, 0.25, 0.5, 0.75):
        lines("fit", share)
    assert stream.getvalue().splitlines() == ["        fit, 25 %; about 36 s left", "        fit, 75 %; about 8 s left"]


def test_long_commands_tell_their_steps_and_none_when_quiet(cli, monkeypatch):
    monkeypatch.setattr(progress, "EVERY_S", 0.0)
    assert "check 1 of" in cli("data", "check", "./toyset").stderr
    assert cli("data", "check", "./toyset", "-q").stderr == ""
    assert cli("data", "check", "./toyset", "--json").stderr == ""


def test_a_fit_of_a_network_tells_its_epochs(cli, monkeypatch, undrawn):
    monkeypatch.setattr(progress, "EVERY_S", 0.0)
    done = cli("run", "-m", "mlp[epochs=3,hidden=4]", "-d", "./toyset", *QUICK, "-o", "m")
    assert "mlp[epochs=3,hidden=4] seed 0: 2 fits together: epoch 2 of 3, 67 %" in done.stderr
    assert os.path.exists("m/toyset.md")
