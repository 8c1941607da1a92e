"""The Python interface: data sets as sequences, in frames and in notebooks."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shipbench as sb
from shipbench.errors import InputError

ROOT = Path(__file__).parent.parent


def test_a_data_set_is_a_sequence_of_runs(harbour):
    assert [run.id for run in harbour] == [run.id for run in harbour.runs]
    assert harbour["run7"] is harbour[7] is harbour.runs[7]
    assert harbour[-1] is harbour.runs[-1]
    assert "run7" in harbour
    assert "run99" not in harbour
    assert [run.id for run in harbour[2:8:3]] == ["run2", "run5"]
    assert harbour[:2].ship is harbour.ship
    assert np.array_equal(harbour[0].commands, harbour[0].inputs[:, :4])
    with pytest.raises(InputError, match=r"unknown run 'run77'\. Did you mean 'run7'"):
        harbour["run77"]
    with pytest.raises(IndexError):
        harbour[16]


def test_a_frame_gives_back_the_same_samples(harbour):
    frame = harbour.to_frame()
    assert list(frame.columns[:5]) == ["trajectory", "t", "x", "y", "psi"]
    assert len(frame) == sum(map(len, harbour))
    again = sb.Dataset.from_frame(frame, harbour.ship, name=harbour.name)
    assert again.fingerprint == harbour.fingerprint
    assert again.dt == harbour.dt


def test_a_frame_may_have_environment_channels_metadata_and_a_ship_file(harbour, tmp_path):
    (tmp_path / "ship.toml").write_text(harbour.ship.to_toml())
    frame = harbour[:2].to_frame().assign(depth=12.5, remark="calm")
    data = sb.Dataset.from_frame(frame, tmp_path / "ship.toml", meta={"run1": {"manoeuvre": "turn"}}, licence="MIT")
    assert data.inputs[-1] == "depth"
    assert (data["run0"].inputs[:, -1] == 12.5).all()
    assert data["run1"].kind == "turn"
    assert data.licence == "MIT"
    tenths = frame.assign(t=frame["t"] / 10.0)
    assert sb.Dataset.from_frame(tenths, harbour.ship).dt == 0.1


def test_actuators_that_a_frame_lacks_are_noted(harbour):
    data = sb.Dataset.from_frame(harbour[:2].to_frame().drop(columns=["F_b", "F_b_c"]), harbour.ship, notes=["mine"])
    assert data.notes == ("mine", "F_b and F_b_c are not recorded: taken as zero")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.drop(columns="psi"), "frame lacks psi"),
        (lambda f: f.drop(columns="trajectory"), 'frame.assign(trajectory="run1")'),
        (lambda f: f.assign(u="fast"), "frame, row 0: u is 'fast', not a number"),
        (lambda f: f.assign(u=True), "u is 'True', not a number"),
        (lambda f: f.iloc[:0], "frame has no rows"),
        (lambda f: f.to_dict(), "frame is of the type dict"),
        (lambda f: f.assign(t=f["t"] ** 2), "Resample the run"),
        (lambda f: f.set_axis(["trajectory", "t", "x", "x", *f.columns[4:]], axis=1), "2 columns are 'x'"),
    ],
)
def test_a_frame_that_is_no_data_set_is_refused(harbour, change, message):
    with pytest.raises(InputError, match=re.escape(message)):
        sb.Dataset.from_frame(change(harbour[:2].to_frame()), harbour.ship)


def test_metadata_of_an_unknown_run_are_refused(harbour):
    with pytest.raises(InputError, match="unknown run in meta 'run9'"):
        sb.Dataset.from_frame(harbour[:2].to_frame(), harbour.ship, meta={"run9": {}})


def test_a_data_set_shows_a_paragraph_and_a_picture(harbour):
    text = repr(harbour)
    for part in ("16 runs", "40 s each", "container130", "L = 130 m"):
        assert part in text
    hostile = harbour.with_runs([replace(harbour[0], id="<b>")])
    html = hostile._repr_html_()
    assert "<b>" not in html.replace("<b>Data set", "")
    assert html.count("<path") == 2  # a track and the scale
    still = harbour[0].slice(0, 1)
    assert "nan" not in harbour.with_runs([still])._repr_html_()


def test_the_package_says_that_it_is_typed():
    assert (ROOT / "shipbench/py.typed").is_file()
