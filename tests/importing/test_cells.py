"""Numbers as logs write them: thousands, decimal commas, minus signs. Advice on what can be read in two ways fits the
other cells."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from trial import logged, mapping

from shipbench.data.base import load_dataset
from shipbench.importing.mapping import Layout
from shipbench.importing.numerals import UnreadError, survey, to_floats

POINTS, COMMAS = pa.array(["4.13", "0.5"]), pa.array(["4,13", "0,5"])
T = np.arange(0.0, 60.0, 0.5)


def read(cells: list[str | None], others: pa.Array = POINTS, **layout) -> list[float]:
    text = pa.array(cells, pa.large_string())
    return to_floats(text, Layout(**layout), lambda: survey([text, others])).to_pylist()


@pytest.mark.parametrize(
    ("cells", "layout", "numbers"),
    [
        (["990", "1,090", "-12,345.5"], {"thousands": ","}, [990.0, 1090.0, -12345.5]),
        (["990", "1.090", "1.234.567,5"], {"decimal": ",", "thousands": "."}, [990.0, 1090.0, 1234567.5]),
        (["1 090", "1\u00a0090", "1\u202f090,5"], {"decimal": ",", "thousands": " "}, [1090.0, 1090.0, 1090.5]),
        (["1'090", "1\u2019090.25"], {"thousands": "'"}, [1090.0, 1090.25]),
        (["990", "1.090"], {"decimal": "."}, [990.0, 1.09]),
        (["\u22123.5", "\u22123.7e\u221205", "+2", None], {}, [-3.5, -3.7e-05, 2.0, None]),
        (["1.5D+03", "-2d-1"], {}, [1500.0, -0.2]),
        (
            ["52.1234", "52.123"],
            {"decimal": ","},
            [52.1234, 52.123],
        ),  # only a decimal point can stand before four digits
        (["350", "1.125", "0.5"], {}, [350.0, 1.125, 0.5]),
    ],
)
def test_numbers_are_read_as_they_are_meant(cells, layout, numbers):
    others = COMMAS if layout.get("decimal") == "," else POINTS
    assert read(cells, others, **layout) == numbers


@pytest.mark.parametrize(
    ("cells", "others", "layout", "row", "advice"),
    [
        (["990", "1.090"], COMMAS, {"decimal": ","}, 1, 'thousands = "."'),
        (["1.090", "1.090"], COMMAS, {"decimal": ","}, 0, 'thousands = "."'),
        (["990", "1,090"], POINTS, {}, 1, 'thousands = ","'),
        (["990.5", "1'090.5"], POINTS, {}, 1, 'thousands = "\'"'),
        (["1,090"], POINTS, {"decimal": ","}, 0, 'decimal = "." and thousands = ","'),
        (["990", "1.090", "999"], pa.array(["12"]), {}, 1, 'thousands = "."'),
        (["4,13"], COMMAS, {}, 0, 'decimal = ","'),
        (["1,090"], pa.array(["12"]), {}, 0, 'thousands = "," if it is a thousand, or decimal = ","'),
        (["4,13", "5.2"], POINTS, {}, 0, "one decimal mark"),
        (["4,13", "52.1234"], COMMAS, {"decimal": ","}, 0, "one decimal mark"),
        (["1,09"], POINTS, {"thousands": ","}, 0, "groups of three digits"),
        (["1 090"], POINTS, {}, 0, 'thousands = " "'),
    ],
)
def test_what_can_be_read_in_two_ways_is_refused(cells, others, layout, row, advice):
    with pytest.raises(UnreadError) as error:
        read(cells, others, **layout)
    assert error.value.row == row
    assert advice in error.value.hint


def test_grouped_shaft_speeds_are_refused_with_advice_that_reads_them(trial_import):
    table = logged(T)
    table["rpm"] = [f"{990 + 2 * k:,}" for k in range(len(T))]  # crosses 1000
    refused = trial_import(table)
    assert refused.exit_code == 2
    assert "row 7: 'rpm' is '1,000', not a number." in refused.stderr
    assert 'set [file] thousands = ","' in refused.stderr
    assert "decimal" not in refused.stderr.replace("decimal numbers", "").replace("decimal points", "")
    assert trial_import(table, mapping(tables='[file]\nthousands = ","\n')).exit_code == 0
    np.testing.assert_allclose(load_dataset("out").runs[0].states[1:-1, 6], 990.0 + 4.0 * np.arange(1, 59), atol=1e-6)


def test_a_wrong_decimal_comma_is_refused_by_the_points_of_the_other_columns(trial_import):
    table = logged(T)
    table["rpm"] = "1,090"
    refused = trial_import(table, mapping(tables='[file]\ndecimal = ","\n'))
    assert refused.exit_code == 2
    assert 'Set decimal = "." and thousands = ","' in refused.stderr


def test_a_word_is_offered_as_missing_but_a_number_never(trial_import):
    table = logged(T).astype(object)
    table.loc[3, "HDG"] = "---"
    assert 'missing = ["---"]' in trial_import(table).stderr
    table.loc[3, "HDG"] = "12x"
    told = trial_import(table).stderr
    assert "'HDG' is '12x', not a number" in told
    assert "missing" not in told


def test_equal_marks_are_refused(trial_import):
    assert "two marks" in trial_import(logged(T), mapping(tables='[file]\nthousands = "."\n')).stderr
