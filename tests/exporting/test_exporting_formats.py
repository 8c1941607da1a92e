"""`export`: what it writes, and one message for what cannot be written."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

import shipbench
from shipbench.cli.app import app
from shipbench.errors import InputError
from shipbench.exporting.formats import FORMATS
from shipbench.predictors.base import make_predictor, parse_spec

LIGHT = ("c", "casadi", "matlab", "json")


@pytest.fixture
def place(tmp_path, monkeypatch):
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize("format", LIGHT)
def test_it_is_named_after_ship_and_model(saved, place, format):
    path = shipbench.export_model(saved("physics+current[speed=0.4,to=1.0]"), format)
    assert path == Path(f"container130_physics_current{FORMATS[format].suffix or '_c'}")
    assert [p.name for p in place.iterdir()] == [path.name]


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_command_writes_an_fmu_and_says_where(saved, place):
    done = CliRunner().invoke(app, ["export", saved("physics"), "--format", "fmu", "--fmi", "3", "--out", "a.fmu"])
    assert (done.exit_code, done.stdout) == (0, "Written: a.fmu\n")
    assert shipbench.export_model("../model", "fmu") == Path("container130_physics.fmu")


@pytest.mark.parametrize("format", LIGHT)
def test_what_is_there_stays_without_force(saved, place, format):
    folder, out = saved("physics"), f"ship{FORMATS[format].suffix}"
    shipbench.export_model(folder, format, out)
    with pytest.raises(InputError, match=r"is there already\. Give another out=, or force=True to replace it"):
        shipbench.export_model(folder, format, out)
    before = sorted(p.name for p in place.rglob("*"))
    shipbench.export_model(folder, format, out, force=True)
    assert sorted(p.name for p in place.rglob("*")) == before


def test_c_may_fill_an_empty_folder(saved, place):
    shipbench.export_model(saved("physics"), "c", ".")
    assert {p.name for p in place.iterdir()} == {"model.c", "model.h", "test.c", "README.txt"}


def test_force_replaces_nothing_of_another_kind(saved, place):
    folder = saved("physics")
    Path("notes").mkdir()
    Path("notes/mine.txt").write_text("x")
    Path("file").write_text("x")
    Path("folder.m").mkdir()
    for format, out, message in (
        ("c", "notes", "holds more than an exported model"), ("c", "file", "is no folder"),
        ("matlab", "folder.m", "is no file"), ("json", f"{folder}/law.json", "lies in the folder of the model"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            shipbench.export_model(folder, format, out, force=True)
    assert Path("notes/mine.txt").read_text() == "x"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--format", "fmus"), r"unknown format 'fmus'\. Did you mean 'fmu'\?"),
        (("--format", "fmu", "--fmi", "1"), "--fmi 1; accepted: 2 or 3"),
        (("--format", "matlab", "-o", "my model.m"), r"cannot be one\. Accepted: letters.*such as my_model.m"),
        (("--format", "matlab", "-o", "for.m"), "such as m_for.m"),
        (("--format", "json", "-o", "ship.txt"), r"ends in '\.txt'; accepted: a file name that ends in \.json"),
    ],
)
def test_bad_options_are_one_message(saved, place, arguments, message):
    done = CliRunner().invoke(app, ["export", saved("physics"), *arguments])
    assert done.exit_code == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert re.search(message, done.stderr), done.stderr
    assert not list(place.iterdir())


@pytest.mark.parametrize("model", ["physics", "nowhere", "my.py:Net", "."])
def test_what_is_no_saved_model_is_one_message(place, model):
    done = CliRunner().invoke(app, ["export", model, "--format", "json"])
    assert done.exit_code == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "saved model" in done.stderr


def test_another_model_says_which_can_be_exported(harbour, place):
    make_predictor(parse_spec("hold")).fit(harbour.subset([0, 1])).save("hold")
    with pytest.raises(InputError, match=r"is 'hold', which is not physics alone.*Accepted: physics, calibrated"):
        shipbench.export_model("hold", "json")


def test_a_hostile_saved_model_writes_nothing_outside(made, place):
    model = made("physics")
    model.ship = model.ship.model_copy(update={"name": "../../../../evil; $(rm -rf)\n"})
    model.save("model")
    before = set(place.parent.rglob("*"))
    path = shipbench.export_model("model", "matlab")
    assert path == Path("evil_rm_rf_physics.m")
    assert set(place.parent.rglob("*")) - before == {place / path}
    assert path.read_text().isascii()
