"""Intervals of every model on one axis."""

from __future__ import annotations

import re

import numpy as np

from shipbench.leaderboard.strips import strips
from shipbench.render.table import Table, TableColumn, number


def drawn(rows: list[dict]) -> list[dict]:
    return strips(Table("T", [TableColumn("ED [m]", "ed_mean", number(2), interval=True)], rows))


def at(svg: str, name: str) -> list[float]:
    return [float(x) for x in re.findall(rf'{name}="([\d.]+)%"', svg)]


def test_a_mean_lies_inside_its_interval_and_a_larger_one_to_the_right():
    (strip,) = drawn([
        {"model": "a", "ed_mean": 2.0, "ed_mean_low": 1.5, "ed_mean_high": 3.0},
        {"model": "b", "ed_mean": 4.0, "ed_mean_low": 3.5, "ed_mean_high": 4.5},
    ])  # fmt: skip
    (_, text, first), (_, _, second) = strip["rows"]
    interval = first[first.index("interval") :]
    assert at(interval, "x1")[0] < at(first, "cx")[0] < at(interval, "x2")[0]
    assert at(first, "cx")[0] < at(second, "cx")[0]
    assert text.startswith("2.00 (1.50 to")


def test_a_row_without_a_figure_or_from_elsewhere_is_not_drawn():
    (strip,) = drawn([
        {"model": "a", "ed_mean": 2.0}, {"model": "none", "ed_mean": np.nan},
        {"model": "paper", "ed_mean": 13.5, "_reference": True},
    ])  # fmt: skip
    assert [name for name, *_ in strip["rows"]] == ["a"]


def test_a_column_without_interval_has_no_strip():
    assert strips(Table("T", [TableColumn("ED [m]", "ed_mean", number(2))], [{"model": "a", "ed_mean": 1.0}])) == []
