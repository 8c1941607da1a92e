"""Tables without a row of names: columns by number, apart by runs of blanks or by a delimiter, after a preamble."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd
import pytest
from trial import logged, mapping

from shipbench.data.base import load_dataset
from shipbench.importing.blanks import Collapsed
from shipbench.importing.mapping import Layout
from shipbench.importing.tables import open_table

T = np.arange(0.0, 40.0)
NUMBERED = """[channels]
x = { column = "2", unit = "m" }
y = { column = "3", unit = "m" }
psi = { column = "4", unit = "deg" }
"""


def written(separator: str, preamble: str) -> str:
    table = logged(T)[["time", "north", "east", "HDG"]]
    rows = [separator.join(f"{value:.6f}" for value in row) for row in table.to_numpy()]
    return preamble + "\n".join(f"  {row} " if separator.isspace() else row for row in rows) + "\n"


@pytest.mark.parametrize(("separator", "delimiter"), [("   ", " "), (" \t ", " "), (",", ","), (";", ";")])
@pytest.mark.parametrize("preamble", ["", " A basin, experimental data\n Z10/5\n"])
def test_a_table_without_a_header_is_read_by_the_numbers_of_its_columns(
    trial_import, tmp_path, separator, delimiter, preamble
):
    layout = f'[file]\nheader = 0\nskip = {preamble.count(chr(10))}\ndelimiter = "{delimiter}"\n'
    done = trial_import(written(separator, preamble), mapping(time='column = "1"', tables=layout, body=NUMBERED))
    assert done.exit_code == 0, done.output
    run = load_dataset(tmp_path / "out").runs[0]
    np.testing.assert_allclose(run.states[:, 0], logged(T)["north"], atol=1e-5)
    assert len(run.t) == len(T)


def test_a_workbook_without_a_header_is_read_by_the_numbers_of_its_columns(trial_import, tmp_path):
    logged(T)[["time", "north", "east", "HDG"]].to_excel(tmp_path / "log.xlsx", index=False, header=False)
    done = trial_import(
        [tmp_path / "log.xlsx"], mapping(time='column = "1"', tables="[file]\nheader = 0\n", body=NUMBERED)
    )
    assert done.exit_code == 0, done.output
    np.testing.assert_allclose(load_dataset(tmp_path / "out").runs[0].states[:, 1], logged(T)["east"], atol=1e-6)


def test_blanks_around_and_between_are_one_blank_whatever_the_size_of_a_read():
    text = b"  a\t b \r\n\n1   2\n 3 4  "
    assert Collapsed(io.BytesIO(text)).read() == b"a b\r\n\n1 2\n3 4"
    small = Collapsed(io.BytesIO(text))
    assert b"".join(iter(lambda: small.read(1), b"")) == b"a b\r\n\n1 2\n3 4"


def test_a_header_with_blanks_names_the_columns(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("  t    x\n 0.0  1.0\n 1.0  2.0\n")
    table = open_table(path, Layout(delimiter=" "))
    assert table.columns == ("t", "x")
    assert pd.concat([b.to_pandas() for b in table.batches(["x"])])["x"].tolist() == ["1.0", "2.0"]


def test_rows_of_delimiters_alone_are_empty_lines(trial_import, tmp_path):
    table = logged(T)[["time", "north", "east", "HDG"]].to_csv(index=False, header=False, sep="\t")
    done = trial_import(
        table + 2000 * "\t\t\n",
        mapping(time='column = "1"', tables='[file]\nheader = 0\ndelimiter = "\\t"\n', body=NUMBERED),
    )
    assert done.exit_code == 0, done.output
    assert len(load_dataset(tmp_path / "out").runs[0].t) == len(T)


def test_many_rows_that_do_not_fit_are_one_message(trial_import, capfd):
    done = trial_import(logged(T).to_csv(index=False) + 2000 * "1,2,3\n")
    assert done.exit_code == 2
    assert "has 3 fields; accepted: 10" in done.stderr
    assert "Traceback" not in capfd.readouterr().err
