"""Formats of a leaderboard: which are known, and figures that are not rounded in CSV."""

from __future__ import annotations

import io

import pandas as pd
import pytest
from made_results import results

from shipbench.errors import InputError
from shipbench.leaderboard.formats import FORMATS, check_formats, csv, render
from shipbench.leaderboard.pages import build_board


def test_known_formats_pass_and_others_are_refused():
    check_formats(list(FORMATS))
    with pytest.raises(InputError, match="no format is given; accepted: md, latex, csv, html"):
        check_formats([])
    with pytest.raises(InputError, match=r"latx.*latex"):
        check_formats(["md", "latx"])


def test_csv_holds_every_figure_unrounded():
    board = build_board(results({"m": [[1.0, 2.0, 4.0]]}), "toy")
    rows = pd.read_csv(io.StringIO(csv(board)))
    first = rows[(rows["table"] == board.tables[0].title) & rows["figure"].str.startswith("ED \u03bc")].iloc[0]
    assert first["value"] == pytest.approx(7.0 / 3.0, rel=1e-12)
    assert first["low"] < first["value"] < first["high"]


@pytest.mark.parametrize(
    ("name", "begins"), [("md", "# "), ("latex", "% "), ("csv", "dataset,"), ("html", "<!doctype")]
)
def test_a_format_gives_its_suffix_and_its_text(tmp_path, name: str, begins: str):
    suffix, text = render(build_board(results({"m": [[1.0, 2.0]]}), "toy"), name, "shipbench leaderboard", [], tmp_path)
    assert suffix == FORMATS[name]
    assert text.lower().startswith(begins)
