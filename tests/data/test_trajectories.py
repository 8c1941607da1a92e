"""Tables of strangers: the size is known before memory is taken, metadata decide nothing, and no damage ends in a
traceback."""

from __future__ import annotations

import contextlib
import gzip
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shipbench.data import trajectories
from shipbench.data.files import read_dataset
from shipbench.errors import InputError
from shipbench.signals import COMMANDS, STATES

COLUMNS = ("trajectory", "t", *STATES, *COMMANDS)


def described(folder: Path) -> Path:
    (folder / "dataset.toml").write_text('name = "toy"\ndt = 1.0\nactuators = "measured"\n')
    (folder / "ship.toml").write_text('name = "toy"\nL = 50.0\nB = 8.0\nT = 3.0\nmass = 9e5\n')
    return folder


def table(rows: int = 8) -> pd.DataFrame:
    return pd.DataFrame({name: np.arange(rows, dtype=float) for name in COLUMNS}).assign(trajectory="a")


def csv(rows: int = 8) -> bytes:
    return table(rows).to_csv(index=False).encode()


def parquet(folder: Path, **columns: object) -> pa.Table:
    """The table in Parquet, with columns replaced or added."""
    made = pa.Table.from_pandas(table(), preserve_index=False)
    for name, values in columns.items():
        values = pa.array(values) if not isinstance(values, pa.Array) else values
        made = (
            made.set_column(made.column_names.index(name), name, values)
            if name in made.column_names
            else made.append_column(name, values)
        )
    pq.write_table(made, folder / "trajectories.parquet")
    return made


def refused(folder: Path, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_dataset(folder)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600


def test_a_text_that_unpacks_without_end_is_refused_before_it_is_parsed(tmp_path, monkeypatch):
    monkeypatch.setattr(trajectories, "MOST_BYTES", 3_000_000)
    parsed = []
    monkeypatch.setattr(pd, "read_csv", lambda *args, **options: parsed.append(args))
    (described(tmp_path) / "trajectories.csv.gz").write_bytes(
        gzip.compress(csv() + b"a,8" + b",0" * 14 + b"\n" * 4_000_000)
    )
    refused(tmp_path, r"holds more than 3 MB of text; accepted")
    assert not parsed


@pytest.mark.parametrize("name", ["trajectories.csv", "trajectories.csv.gz", "trajectories.parquet"])
def test_more_cells_than_memory_holds_are_refused(tmp_path, monkeypatch, name):
    monkeypatch.setattr(trajectories, "MOST_CELLS", 16 * 100)
    large, path = table(101), described(tmp_path) / name
    large.to_parquet(path) if name.endswith("parquet") else large.to_csv(path, index=False)
    refused(tmp_path, r"has 10[12] rows of 16 signals; accepted: up to 100 such rows")


def test_a_declared_size_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(trajectories, "MOST_BYTES", 1_000_000)
    kept = np.repeat(np.random.default_rng(0).normal(size=8), 10_000)
    large = pd.DataFrame(dict.fromkeys(COLUMNS, kept)).assign(trajectory="a")
    large.to_parquet(described(tmp_path) / "trajectories.parquet", compression="gzip", use_dictionary=False)
    refused(tmp_path, r"holds \d+ MB unpacked; accepted: up to 1 MB")


def test_a_long_text_in_every_row_is_not_copied_into_each(tmp_path):
    described(tmp_path)
    parquet(tmp_path, trajectory=pa.DictionaryArray.from_arrays(pa.array([0] * 8), pa.array(["a" * 5_000_000])))
    refused(tmp_path, r"'trajectory' holds a text of more than 1000 characters")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (csv().replace(b"\n", b"," + b"x" * 1_200_000 + b"\n", 1), "line of more than 1 MB"),
        (csv() + b'"' + b"a" * 1_200_000, "line of more than 1 MB"),
        (b",".join(b"c%d" % i for i in range(20_000)) + b"\n1\n", "20000 columns; accepted: up to 10000"),
        (csv().decode().encode("utf-16"), "not UTF-8"),
        (csv().replace(b"\na,", b"\n\xe4,"), "not UTF-8"),
        (csv().replace(b"a,1.0,1.0", b"a,1.0," + b"9" * 500), "x is inf"),
        (csv().replace(b"a,1.0,1.0", b"a,1.0,1e999"), "x is inf"),
        (csv().replace(b"a,1.0,1.0", b"a,1.0,1e308"), "x is 1e.308"),
        (table().assign(u=True).to_csv(index=False).encode(), "u is 'True', not a number"),
        (csv(1), "has 1 sample"),
        (csv().replace(b"a,3.0", b"a,3.5"), "dt in dataset.toml is 1 s"),
        (b"", "cannot be read"),
        (b"\n\n\n", "cannot be read"),
        (b"\x00" * 1000, "."),
    ],
    ids=[
        "long head",
        "open quote",
        "columns",
        "utf-16",
        "latin-1",
        "digits",
        "infinite",
        "huge",
        "truth",
        "one sample",
        "step",
        "empty",
        "blank",
        "zeros",
    ],
)
def test_absurd_text_is_refused_in_one_message(tmp_path, content, message):
    (described(tmp_path) / "trajectories.csv").write_bytes(content)
    refused(tmp_path, message)


ODD: dict[str, tuple[dict[str, object], str]] = {
    "truth values": ({"u": [True] * 8}, "u is 'true', not a number"),
    "text": ({"u": ["1", "2", "x", *"45678"]}, "row 4: u is 'x', not a number"),
    "stamps": ({"t": pa.array(range(8), pa.timestamp("ms"))}, "t is '1970"),
    "lists": ({"x": [[1.0]] * 8}, "column 'x' holds list"),
    "bytes": ({"trajectory": [b"a"] * 8}, "column 'trajectory' holds binary; accepted: text"),
    "a name missing": ({"trajectory": ["a"] * 7 + [None]}, "row 9 has no run name"),
    "nothing": ({"v": pa.nulls(8)}, "v is nan"),
}


@pytest.mark.parametrize("case", ODD)
def test_odd_columns_of_parquet_are_refused_by_name(tmp_path, case):
    columns, message = ODD[case]
    parquet(described(tmp_path), **columns)
    refused(tmp_path, message)


def test_kinds_of_numbers_and_of_names_are_read(tmp_path):
    decimals = pa.array(range(8)).cast(pa.decimal128(21, 2))
    parquet(
        described(tmp_path),
        x=pa.array(range(8), pa.int16()),
        y=decimals,
        u=pa.array(np.arange(8, dtype=np.float16)),
        trajectory=[7] * 8,
        note=[b"\xff"] * 8,
    )
    (run,) = read_dataset(tmp_path).runs
    assert run.id == "7"
    np.testing.assert_array_equal(run.states[:, [0, 1, 3]], np.tile(np.arange(8.0)[:, None], 3))


PANDAS = {
    "index_columns": ["x"],
    "columns": [{"field_name": "x", "name": None, "pandas_type": "unicode", "metadata": {"encoding": "rot13"}}],
}


@pytest.mark.parametrize(
    "about", [b"{", b"[]", b"\xff", str(PANDAS).replace("'", '"').replace("None", "null").encode()]
)
def test_what_pandas_wrote_beside_the_columns_decides_nothing(tmp_path, about):
    made = parquet(described(tmp_path))
    pq.write_table(made.replace_schema_metadata({"pandas": about}), tmp_path / "trajectories.parquet")
    np.testing.assert_array_equal(read_dataset(tmp_path).runs[0].states[:, 0], np.arange(8.0))


@pytest.mark.parametrize("name", ["trajectories.parquet", "trajectories.csv.gz"])
def test_a_damaged_or_shortened_table_is_refused_or_read(tmp_path, name):
    path = described(tmp_path) / name
    table(200).to_parquet(path) if name.endswith("parquet") else table(200).to_csv(path, index=False)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    for k in range(40):
        damaged = bytearray(whole)
        damaged[int(rng.integers(len(whole)))] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged) if k % 2 else whole[: int(rng.integers(len(whole)))])
        with contextlib.suppress(InputError):
            read_dataset(tmp_path)


def pipe(path: Path) -> None:
    os.mkfifo(path)


@pytest.mark.parametrize("name", ["dataset.toml", "ship.toml", "trajectories.csv"])
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (pipe, "a named pipe"),
        (Path.mkdir, "a folder"),
        (lambda p: p.symlink_to("/dev/zero"), "a device"),
        (lambda p: p.symlink_to("no"), "does not exist"),
    ],
)
def test_what_is_no_regular_file_in_a_folder_is_refused(tmp_path, name, make: Callable[[Path], None], message):
    (described(tmp_path) / "trajectories.csv").write_bytes(csv())
    (tmp_path / name).unlink()
    make(tmp_path / name)
    refused(tmp_path, message)


def test_a_link_to_a_table_elsewhere_is_followed(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "object").write_bytes(csv())
    (described(tmp_path) / "trajectories.csv").symlink_to("store/object")
    assert len(read_dataset(tmp_path).runs[0]) == 8


@pytest.mark.parametrize(
    "ship", ["../ship.toml", "/etc/passwd", "a/../../ship.toml", "..\\\\ship.toml", "C:/ship.toml"]
)
def test_the_ship_lies_in_the_folder(tmp_path, ship):
    (described(tmp_path) / "trajectories.csv").write_bytes(csv())
    with (tmp_path / "dataset.toml").open("a") as file:
        file.write(f'ship = "{ship}"\n')
    refused(tmp_path, "lies outside the folder of the data set; accepted")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            table().to_csv(index=False, sep=";", decimal=","),
            "has semicolons between its columns, as with decimal commas; accepted: commas there",
        ),
        (table().to_csv(index=False, sep="\t"), "has tabs between its columns"),
        (
            table().assign(x=["0,0", "4,126667", *["5,5"] * 6]).to_csv(index=False),
            "row 2: 'x' is '0,0', with a comma; accepted: decimal points",
        ),
        (table().assign(n=["990", "1,090", *["999"] * 6]).to_csv(index=False), "row 3: 'n' is '1,090', with a comma"),
    ],
)
def test_other_delimiters_and_decimal_commas_say_how_to_save_the_table(tmp_path, text, message):
    described(tmp_path)
    (tmp_path / "trajectories.csv").write_text(text)
    refused(tmp_path, message)
