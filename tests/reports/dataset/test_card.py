"""The data card: two pages that say the same, one of them whole in itself."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from hostile import HOSTILE, Elements, card_of, drawings
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset
from shipbench.errors import InputError
from shipbench.records import Dataset, Run
from shipbench.reports.dataset.card import make_card
from shipbench.reports.dataset.card_page import write_card
from shipbench.reports.dataset.coverage import coverage
from shipbench.reports.dataset.coverage_svg import svg

SHARED = Path(__file__).parents[4] / "shared" / "data" / "esso-osaka-frt"


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def test_a_card_is_written_printed_and_given_as_json(cli, toy_folder, tmp_path):
    result = cli("data", "describe", toy_folder(), "--out", "card")
    assert result.exit_code == 0, result.output
    assert result.stdout.rstrip().endswith("Written: card/card.md, card/card.html")
    assert "What these data cannot identify" in result.stdout
    pictures = {"speed_drift.png", "rudder_rpm.png", "headings.png", "yaw_speed.png"}  # no thrusters, no wind
    assert {p.name for p in (tmp_path / "card").iterdir()} == {"card.md", "card.html"} | pictures
    text = (tmp_path / "card/card.md").read_text()
    assert set(re.findall(r"\]\((\S+?)\)", text)) == pictures
    for word in (
        "- licence: MIT",
        "- source: formula",
        "One sample every 1 s",
        "Noise of the channels",
        "| shallow water | depth is not recorded |",
    ):
        assert word in text
    again = cli("data", "describe", "toyset", "--out", "card", "--json")
    document = json.loads(again.stdout)
    assert document["dataset"] == "toyset"
    assert all(row["subject"] in text for row in document["cannot_identify"]["rows"])
    assert {row["channel"] for row in document["noise"]["rows"]} >= {"x", "psi", "u", "r", "n"}
    assert document["durations"]["rows"][0]["median"] == 40.0
    assert text == (tmp_path / "card/card.md").read_text(), "the same data give the same page"


def test_the_page_fetches_nothing_and_text_from_the_data_stays_text(tmp_path):
    page = card_of(tmp_path)
    text = page.read_text()
    tags = Elements(text).tags
    assert [a.get("type") for tag, a in tags if tag == "script"] == ["application/json", None, None, None, None]
    assert "img" not in dict(tags)
    for _, attributes in tags:
        assert "src" not in attributes
        assert attributes.get("href", "#").startswith("#")
        assert not [name for name in attributes if name.startswith("on")]
    assert "content=\"default-src 'none'; base-uri 'none'; form-action 'none'; style-src-elem 'sha256-" in text
    assert "width=device-width" in text
    assert "<script" not in page.with_name("card.md").read_text()
    assert not Elements(page.with_name("card.md").read_text()).tags


def test_the_page_has_one_header_tiles_and_the_runs_as_linked_plots(tmp_path):
    text = card_of(tmp_path).read_text()
    tiles = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)<small>", text))
    assert set(tiles) == {"Cannot be identified", "Runs", "Samples", "Duration", "Time step dt", "Ship"}
    assert (tiles["Runs"], tiles["Samples"], tiles["Duration"], tiles["Time step dt"]) == ("30", "930", "0.25 h", "1 s")
    assert "shipbench data describe &lt;img" in text
    runs = drawings(text)["runs"]
    assert len(runs) == 24
    assert runs[-1]["note"] == HOSTILE, "of every kind of manoeuvre one run at least is drawn"
    assert text.count("<figure><h3>") == 4
    assert "24 of 30 runs, from every kind of manoeuvre." in text


def test_a_drawing_holds_the_time_of_every_cell(harbour):
    for covered in coverage(harbour):
        drawn, levels = svg(covered, harbour.dt)
        assert "nan" not in drawn
        if levels:
            assert len(levels) == 5
            assert drawn.count("z") - drawn.count('class="zero"') == np.count_nonzero(covered.seconds)
        else:
            assert covered.seconds.sum() == pytest.approx(sum(len(r) for r in harbour.runs) * harbour.dt)


def test_thrusters_and_wind_are_drawn_where_there_are_any(harbour):
    names = (*harbour.inputs, "wind_speed", "wind_from")
    windy = harbour.with_runs(
        Run(r.id, r.t, r.states, np.hstack([r.inputs, np.full((len(r), 2), 1.0)]), names) for r in harbour.runs
    )
    assert [c.name for c in coverage(windy)][4:] == ["thrusters", "wind"]


def test_a_folder_that_cannot_be_written_is_one_message(cli, toy_folder):
    Path("file").write_text("x")
    result = cli("data", "describe", toy_folder(), "--out", "file")
    assert result.exit_code == 2
    assert "cannot write the data card to file" in result.stderr


def test_nothing_half_written_is_left(toy_folder, tmp_path, monkeypatch):
    data = load_dataset(str(toy_folder(runs=3)))
    card = make_card(data)

    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        write_card(card, data, tmp_path / "card", "shipbench")
    assert list((tmp_path / "card").iterdir()) == []


@pytest.mark.parametrize(("samples", "speed"), [(2, 3.0), (2, 0.0), (200, 0.0), (200, 1e-9)])
def test_data_that_hold_nearly_nothing_get_a_card_too(toy, tmp_path, samples, speed):
    ship = toy(runs=1).ship
    S, U = np.zeros((samples, 10)), np.zeros((samples, 4))
    S[:, 3], S[:, 0] = speed, speed * np.arange(samples)
    data = Dataset("still", ship, 1.0, (Run("a", np.arange(float(samples)), S, U),))
    card = make_card(data)
    json.dumps(card.document(), allow_nan=False, default=str)
    assert len(card.tables["cannot_identify"].rows) > 8
    write_card(card, data, tmp_path, "shipbench")


@pytest.mark.skipif(not SHARED.is_dir(), reason="no copy of the Esso Osaka data here (not distributed)")
def test_the_card_of_measured_runs(monkeypatch):
    monkeypatch.setenv("SHIPBENCH_ESSO_OSAKA", str(SHARED))
    document = make_card(load_dataset("esso_osaka")).document()
    named = [row["subject"] for row in document["cannot_identify"]["rows"]]
    assert named[:2] == ["lag, rate limit, delay and dead band of rudder and shaft", "shallow water"]
    assert not any("astern" in name or "wind" in name for name in named), "the runs reverse, and their wind is measured"
    noise = {row["channel"]: row["noise"] for row in document["noise"]["rows"]}
    assert 0.001 < noise["x"] < 0.006  # the source's scatter about a 1.1 s mean is 3 to 6 mm, slow motion included
    assert 0.05 < noise["psi"] < 0.21
