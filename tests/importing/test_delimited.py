"""Rows that do not fit the header, encodings, and files that are no logs."""

from __future__ import annotations

import gzip
import io
import zipfile

import numpy as np
import pytest
from trial import logged, mapping

from shipbench.data.base import load_dataset

T = np.arange(0.0, 60.05, 0.5)
TEXT = logged(T).to_csv(index=False)
ROWS = TEXT.splitlines()


def encoded(name: str) -> str:
    return mapping(tables=f'[file]\nencoding = "{name}"\n')


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            TEXT + ROWS[-1].replace("60.0", "60.5", 1)[:60],
            "log.csv, row 123, left out: 4 of 10 fields at the end of the file",
        ),
        (TEXT + "\nEnd of log\n121 rows\n", "row 123, left out: 1 of 10 fields at the end of the file: 'End of log'"),
        (
            TEXT + "Total" + "," * 9 + "\n" + "," * 9 + "\n",
            "2 rows at the end, left out: 'Total' stands for their time",
        ),
    ],
)
def test_a_cut_last_line_and_a_footer_are_left_out_and_reported(trial_import, text, told):
    result = trial_import(text)
    assert result.exit_code == 0, result.output
    assert told in " ".join(result.stdout.split())  # lines are folded at 80 columns
    assert any(told in note for note in load_dataset("out").notes)
    assert load_dataset("out").runs[0].t[-1] == 60.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("\n".join([*ROWS[:50], ROWS[50] + ",7", *ROWS[51:]]), "row 51 has 11 fields; accepted: 10"),
        ("\n".join([*ROWS[:50], "lost", *ROWS[51:]]), "row 51 has 1 fields; accepted: 10"),
        (
            "\n".join([*ROWS[:-9], *(row.rpartition(",")[0] for row in ROWS[-9:])]),
            "row 114 has 9 fields",
        ),  # nine whole rows without a channel
        ("\n".join([ROWS[0], *(row + ",7" for row in ROWS[1:])]), "row 2 has 11 fields; accepted: 10"),
        (TEXT.replace(",110.0,", ",1,110.0,"), 'needs quotes: "1,090"'),
    ],
)
def test_other_rows_that_do_not_fit_are_refused_with_their_number(trial_import, text, told):
    refused = trial_import(text)
    assert refused.exit_code == 2
    assert told in refused.stderr


@pytest.mark.parametrize(
    "name", ["rot13", "base64", "punycode", "idna", "undefined", "unicode_escape", "no-such", "utf-8\0", ""]
)
def test_what_is_no_encoding_of_a_file_is_refused(trial_import, name):
    refused = trial_import(TEXT, encoded(name).replace("\0", "\\u0000"))
    assert refused.exit_code == 2
    assert "is no text encoding" in refused.stderr


@pytest.mark.parametrize("name", ["utf-16-le", "cp1252", "mac-roman"])
def test_a_named_encoding_is_read(trial_import, tmp_path, name):
    path = tmp_path / "log.csv"
    path.write_bytes(TEXT.encode(name))
    result = trial_import([path], encoded(name))
    assert result.exit_code == 0, result.output
    assert "is not UTF-8" not in result.stdout


def test_bytes_that_are_not_utf_8_after_the_beginning_name_the_key(trial_import, tmp_path, monkeypatch):
    monkeypatch.setattr("shipbench.importing.delimited.TEXT_BLOCK", 4096)
    path = tmp_path / "log.csv"
    path.write_bytes((TEXT + ROWS[-1].replace("60.0", "60.5", 1)).encode() + b"\xb0\n")
    assert 'encoding = "cp1252"' in trial_import([path]).stderr


def test_an_archive_says_to_unpack_it(trial_import, tmp_path):
    for name, inside in (("log.zip", "log.csv"), ("log.ods", "content.xml")):
        with zipfile.ZipFile(tmp_path / name, "w") as packed:
            packed.writestr(inside, TEXT)
    assert "is a zip archive (it holds log.csv). Unpack it" in trial_import([tmp_path / "log.zip"]).stderr
    assert "is an OpenDocument file. Save the sheet as .xlsx or .csv" in trial_import([tmp_path / "log.ods"]).stderr


def test_a_log_that_unpacks_to_200_times_its_size_is_refused(trial_import, tmp_path):
    buffer = io.BytesIO()
    with gzip.GzipFile(fileobj=buffer, mode="wb") as file:
        file.write(TEXT.encode())
        for _ in range(12):
            file.write((ROWS[-1] + "\n").encode() * 10_000)
    refused = trial_import(buffer.getvalue(), name="log.csv.gz")
    assert refused.exit_code == 2
    assert "unpacks to more than 200 times its size" in refused.stderr


def test_times_that_are_too_far_away_are_refused(trial_import):
    late = TEXT.replace("\n30.5,", "\n1e25,", 1)
    assert "makes a time of 1e+25 s; accepted: up to 7.3e+09 s" in trial_import(late).stderr
    refused = trial_import(TEXT, mapping(time='column = "time"\nshift = 1e300'))
    assert refused.exit_code == 2
    assert "time.shift" in refused.stderr


@pytest.mark.parametrize("mark", [r"\n", "a", "5", r"\"", "é", "."])
def test_what_cannot_stand_between_columns_is_no_delimiter(trial_import, mark):
    refused = trial_import(TEXT, mapping(tables=f'[file]\ndelimiter = "{mark}"\n'))
    assert refused.exit_code == 2
    assert "accepted: a mark between columns" in refused.stderr


@pytest.mark.parametrize("line", ["rate = 1e-300", "rate = 1e300"])
def test_rates_that_no_log_has_are_refused(trial_import, line):
    refused = trial_import(TEXT, mapping(time=line))
    assert refused.exit_code == 2
    assert "time.rate" in refused.stderr
