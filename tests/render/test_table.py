"""Tables: text of figures and escaping."""

from __future__ import annotations

import pytest

from shipbench.render.table import Table, TableColumn, number, significant


def test_a_table_escapes_what_would_break_markdown_and_gives_null_for_nan():
    table = Table("T", [TableColumn("m|n", "m"), TableColumn("v", "v", number(1))], [{"m": "a|b", "v": float("nan")}])
    assert "| m\\|n | v |" in table.markdown()
    assert "| a\\|b | - |" in table.markdown()
    assert table.as_json()["rows"] == [{"m": "a|b", "v": None}]


@pytest.mark.parametrize(
    ("value", "text"),
    [(12.345, "12.3"), (0.01234, "0.0123"), (1234.5, "1234"), (4e-14, "0"), (1.5e7, "1.5e+07"), (None, "-")],
)
def test_significant_digits(value, text):
    assert significant(3)(value) == text


def test_numbers_too_large_for_a_column_are_written_in_powers_of_ten():
    assert (number(2)(13.518), number(2)(2.5e9)) == ("13.52", "2.50e+09")
