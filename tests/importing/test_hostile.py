"""Bad logs, mappings and folders: exit code 2, one message that helps, no traceback, nothing written."""

from __future__ import annotations

import bz2
import gzip
import io
import os
import re
import subprocess
import sys
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from trial import SHIP, channels, logged, mapping, write
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset
from shipbench.importing.writer import FolderWriter

T = np.arange(0.0, 60.05, 0.5)
TEXT = logged(T).to_csv(index=False)
ROWS = TEXT.splitlines()


def with_cell(row: int, column: int, text: str) -> str:
    """The log with another text in one cell (data rows from 0)."""
    cells = ROWS[1 + row].split(",")
    cells[column] = text
    return "\n".join([*ROWS[: 1 + row], ",".join(cells), *ROWS[2 + row :]]) + "\n"


def swapped() -> str:
    return "\n".join([*ROWS[:10], ROWS[12], ROWS[11], ROWS[10], *ROWS[13:]]) + "\n"


def parquet_bytes() -> bytes:
    buffer = io.BytesIO()
    logged(T).to_parquet(buffer)
    return buffer.getvalue()


LOGS = {
    "empty file": ("log.csv", "", "is empty"),
    "blank file": ("log.csv", "\n\n \n", "holds no text"),
    "header only": ("log.csv", ROWS[0] + "\n", "has a header and no rows"),
    "header only, no newline": ("log.csv", ROWS[0], "has a header and no rows"),
    "binary": ("log.csv", bytes(range(256)) * 200, "is binary"),
    "binary without zeros": ("log.csv", bytes(range(1, 256)) * 200, "latin-1|binary"),
    "random": ("log.csv", np.random.default_rng(0).bytes(5000), "binary"),
    "truncated gzip": ("log.csv.gz", gzip.compress(TEXT.encode())[:2000], "cannot be read"),
    "truncated bzip2": ("log.csv.bz2", bz2.compress(TEXT.encode())[:2000], "cannot be read"),
    "gzip of nothing": ("log.csv.gz", gzip.compress(b""), "holds no text"),
    "cut in a row": ("log.csv", TEXT[:-60] + "\n" + ROWS[-1] + "\n", "row 122 has 7 fields; accepted: 10"),
    "a row too long": (
        "log.csv",
        TEXT + ROWS[-1] + ",1,2\n",
        "row 123 has 12 fields; accepted: 10, as the header has columns",
    ),
    "wrong delimiter": ("log.csv", TEXT.replace(",", "#"), "no column|unknown column"),
    "decimal commas": ("log.csv", TEXT.replace(",", ";").replace(".", ","), 'decimal = ","'),
    "duplicate columns": ("log.csv", TEXT.replace("sway", "surge", 1), "2 columns are named 'surge'"),
    "missing column": ("log.csv", TEXT.replace("HDG", "heading_true", 1), r"'HDG'.*Known: .*heading_true"),
    "time goes back": ("log.csv", swapped(), "time goes back from"),
    "words for numbers": ("log.csv", with_cell(7, 3, "north"), r"row 9: 'HDG' is 'north', not a number"),
    "a formula": ("log.csv", with_cell(7, 4, "=1+1"), r"row 9: 'surge' is '=1\+1', not a number"),
    "a dangerous formula": ("log.csv", with_cell(0, 4, "=cmd|' /C calc'!A0"), "not a number"),
    "a row of units": ("log.csv", f"{ROWS[0]}\ns,m,m,deg,kn,m/s,deg/min,rpm,deg,deg\n", r"\[file\] skip"),
    "many columns": (
        "log.csv",
        ",".join(f"c{i}" for i in range(1_000_000)) + "\n" + ",".join("0" * 1_000_000) + "\n",
        "1000000|longer than",
    ),
    "one endless line": ("log.csv", "a" * 6_000_000, "longer than"),
    "old excel": ("log.xls", b"\xd0\xcf\x11\xe0" + bytes(100), "old format"),
    "no excel": ("log.xlsx", b"PK\x03\x04" + bytes(100), "no Excel workbook"),
    "no matlab": ("log.mat", b"MATLAB 5.0 MAT-file" + bytes(300), "cannot be read|holds no vectors"),
    "matlab 7.3": ("log.mat", b"MATLAB 7.3 MAT-file, HDF5" + bytes(300), "cannot be read|h5py"),
    "truncated parquet": ("log.parquet", parquet_bytes()[:3000], "cannot be read"),
    "no parquet": ("log.parquet", b"PAR1" + bytes(100), "cannot be read"),
    "all values missing": ("log.csv", re.sub(r"(?m)^([\d.]+),.*$", r"\1,,,,,,,,,", TEXT), "no run is left"),
    "too short": ("log.csv", "\n".join(ROWS[:5]) + "\n", "shorter than 20 s"),
    "all one time": (
        "log.csv",
        "\n".join([ROWS[0], *["5.0," + r.split(",", 1)[1] for r in ROWS[1:]]]) + "\n",
        "coarser|no run",
    ),
}


def test_a_run_column_that_holds_no_names_is_one_message(trial_import, tmp_path):
    table = pa.table(
        {name: pa.array(values) for name, values in logged(T).items()} | {"runs": pa.array([{"a": 1}] * len(T))}
    )
    pa.parquet.write_table(table, tmp_path / "log.parquet")
    result = trial_import([tmp_path / "log.parquet"], mapping(top='run = "runs"'))
    assert result.exit_code == 2, result.output
    assert "cannot be read" in result.stderr


CLOCKS = {
    "milliseconds as seconds": ("unix", lambda k: f"{1.7e12 + 500 * k:.0f}", "year 55841; accepted: 1900 to 2199"),
    "days as milliseconds": ("unix_us", lambda k: f"{1.7e18 + 5e5 * k:.0f}", "in the year 558"),
    "a year far off": ("iso", lambda k: f"9999-12-31T00:{k // 60:02d}:{k % 60:02d}", "in the year 10000"),
    "a time of day as a date": ("iso", lambda k: f"10:{k // 60:02d}:{k % 60:02d}", "%H:%M:%S"),
    "a zone without a date": ('%H:%M:%S"\nzone = "UTC', lambda k: f"10:{k // 60:02d}:{k % 60:02d}", "without a date"),
}


@pytest.mark.parametrize("case", CLOCKS)
def test_a_clock_that_cannot_be_is_one_message(trial_import, tmp_path, case):
    form, stamp, expected = CLOCKS[case]
    text = "\n".join([ROWS[0], *(f"{stamp(k)},{row.split(',', 1)[1]}" for k, row in enumerate(ROWS[1:]))])
    result = trial_import(text, mapping(time=f'column = "time"\nformat = "{form}"'))
    assert result.exit_code == 2, result.output
    assert expected in result.stderr
    assert not (tmp_path / "out").exists()


def matlab_of_zeros(path):
    from scipy.io import savemat

    savemat(path, {"time": T, "z": np.zeros(200_000)}, do_compression=True)


def excel_of_zeros(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("xl/sharedStrings.xml", b"<si><t>abc</t></si>" * 600_000)


@pytest.mark.parametrize(
    ("name", "write_log", "expected"),
    [
        ("log.mat", matlab_of_zeros, "more than 1 MB unpacked"),
        ("log.xlsx", excel_of_zeros, "11 MB unpacked"),
    ],
)
def test_a_small_file_that_unpacks_to_a_large_one_is_refused_before_it_is_read(
    trial_import, tmp_path, monkeypatch, name, write_log, expected
):
    monkeypatch.setattr("shipbench.matlab_files.MOST_MATLAB", 1_000_000)
    write_log(tmp_path / name)
    assert (tmp_path / name).stat().st_size < 1_000_000
    result = trial_import([tmp_path / name])
    assert result.exit_code == 2, result.output
    assert expected in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--dt", "1e-9"], "less than 1/100 of the time between samples"),
        (["--window", "0.01"], "split.window = 0.01 s is below dt"),
        (["--dt", "nan"], "finite"),
        (["--out", "new/folders/out", "--shortest", "1e6"], "no run is left"),
    ],
)  # fmt: skip
def test_options_that_make_no_data_set(trial_import, tmp_path, options, expected):
    result = trial_import(TEXT, None, *options)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ")
    assert expected in result.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv", "mapping.toml", "ship.toml"]


def test_the_same_log_twice_is_refused(trial_import, tmp_path):
    path = write(tmp_path, "log.csv", TEXT)
    (tmp_path / "folder").mkdir()
    result = trial_import([path, tmp_path / "folder/../log.csv"])
    assert result.exit_code == 2
    assert "is given twice" in result.stderr


def test_a_name_is_no_path_and_a_link_is_followed(trial_import, tmp_path):
    write(tmp_path, "log.csv", TEXT)
    write(tmp_path, "ship.toml", SHIP)
    command = ["data", "import", "log.csv", "--map", "mapping.toml", "--ship", "ship.toml"]
    (tmp_path / "inner").mkdir()
    (tmp_path / "trial").symlink_to(tmp_path / "inner")
    write(tmp_path, "mapping.toml", mapping().replace('"trial"', '"../../trial"'))
    refused = CliRunner().invoke(app, command)
    assert refused.exit_code == 2
    assert "name = '../../trial' is no name" in refused.stderr
    write(tmp_path, "mapping.toml", mapping())
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in (tmp_path / "inner").iterdir()) == ["dataset.toml", "ship.toml", "trajectories.csv"]
    assert (tmp_path / "trial").is_symlink()


def test_a_full_disk_is_one_message_and_leaves_nothing(tmp_path):
    pytest.importorskip("resource", reason="limits of a process are Unix's")
    write(tmp_path, "log.csv", logged(np.arange(0.0, 4000.0, 0.5)))
    write(tmp_path, "mapping.toml", mapping())
    write(tmp_path, "ship.toml", SHIP)
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)); from "
        "shipbench.cli.app import app; app(sys.argv[1:])"
    )
    command = [
        sys.executable,
        "-c",
        code,
        "data",
        "import",
        "log.csv",
        "--map",
        "mapping.toml",
        "--ship",
        "ship.toml",
        "--out",
        "out",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "cannot write the data set to out" in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv", "mapping.toml", "ship.toml"]


@pytest.mark.parametrize("case", LOGS)
def test_a_bad_log_is_one_message_and_nothing_is_written(trial_import, tmp_path, case):
    name, content, expected = LOGS[case]
    result = trial_import(content, name=name)
    assert result.exit_code == 2, result.output
    assert re.search(expected, result.stderr, re.DOTALL), result.stderr
    assert re.findall(r"(?m)^\w*[Ee]rror\b", result.stderr) == ["error"]
    assert "Traceback" not in result.output
    assert len(result.stderr) < 2500
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "mapping.toml", "ship.toml"])


MAPPINGS = {
    "no TOML": ("name = ", "not valid TOML"),
    "a column in place of a table": (mapping(body=channels(u='"Surge"')), 'such as u = { column = "Surge" }'),
    "unknown key": (mapping(top="delimitter = 3"), "unknown key 'delimitter'"),
    "unknown key in a table": (mapping(tables='[file]\ndelimitter = ";"'), "Did you mean 'delimiter'"),
    "unknown key of a channel": (mapping(body=channels(psi='{ column = "HDG", units = "deg" }')),
        "Did you mean 'unit'|unit: Field required"),
    "unknown key in split": (mapping(tables="[split]\nwindows = 300"), "Did you mean 'window'"),
    "unknown channel": (mapping(body=channels(heading='{ column = "HDG", unit = "deg" }')),
        "unknown channel.*'heading'"),
    "no unit": (mapping(body=channels(psi='{ column = "HDG" }')), "channels.psi.unit: Field required"),
    "unknown unit": (mapping(body=channels(psi='{ column = "HDG", unit = "gon" }')), "unit of 'psi' 'gon'.*deg, rad"),
    "unknown sign": (mapping(body=channels(r='{ column = "ROT", unit = "deg/min", sign = "minus" }')),
        "sign of 'r' 'minus'.*port, starboard"),
    "no heading": (mapping(body=channels("psi")), "no channel 'psi'"),
    "no position": (mapping(body=channels("x", "y")), "no position"),
    "half a position": (mapping(body=channels("y")), "no position|without 'y'"),
    "course without speed": (mapping(body=channels(cog='{ column = "HDG", unit = "deg" }')),
        "'cog' is mapped without 'sog'"),
    "no time": ('name = "a"\ndt = 1.0\n' + channels(), "time: Field required"),
    "no time column": (mapping(time='format = "s"'), r"\[time\] has no column"),
    "unknown format": (mapping(time='column = "time"\nformat = "seconds"'), "format = 'seconds'; accepted: s, ms"),
    "unknown zone": (mapping(time='column = "time"\nformat = "iso"\nzone = "Mars/Olympus"'), "zone = 'Mars/Olympus'"),
    "negative dt": (mapping(top="dt = -1.0"), "dt: Input should be greater than 0"),
    "gap below dt": (mapping(tables="[split]\ngap = 0.1"), "below dt"),
    "stamps that are numbers": (mapping(time='column = "time"\nformat = "iso"'), "not of the format 'iso'"),
    "merged run column": (mapping().replace("[time]", '[sources.a]\nrun = "b"\n[sources.a.time]').replace("[channels]",
            "[sources.a.channels]")
                          + '[sources.b.time]\ncolumn = "t"\n[sources.b.channels]\n'
                            'depth = { column = "d", unit '
                                                                                     '= "m" }\n', "one source"),
}  # fmt: skip


@pytest.mark.parametrize("case", MAPPINGS)
def test_a_bad_mapping_is_one_message_that_helps(trial_import, tmp_path, case):
    plan, expected = MAPPINGS[case]
    result = trial_import(TEXT, plan)
    assert result.exit_code == 2, result.output
    assert re.search(expected, result.stderr, re.DOTALL), result.stderr
    assert not (tmp_path / "out").exists()


def test_cells_that_stand_for_missing_values_are_named_in_the_mapping(trial_import):
    text = with_cell(7, 3, "---").replace(ROWS[12], ROWS[12].replace(ROWS[12].split(",")[6], "-999", 1))
    assert 'missing = ["---"] takes it as missing' in trial_import(text).stderr
    result = trial_import(text, mapping(top='missing = ["---", -999]'))
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    assert np.abs(np.rad2deg(run.states[:, 5])).max() < 3.0


@pytest.mark.parametrize("value", ["inf", "-inf", "nan", "1e400", "1e300"])
def test_values_that_are_no_quantity_are_missing_and_counted(trial_import, value):
    result = trial_import(with_cell(7, 4, value))
    assert result.exit_code == 0, result.output
    assert ("1 infinite values" in result.stdout) == (value != "nan")
    assert np.abs(load_dataset("out").runs[0].states[:, 3]).max() < 5.0


def test_outliers_are_told(trial_import):
    result = trial_import(with_cell(8, 1, "5000"), mapping(top="antialias = false"))
    assert result.exit_code == 0
    assert "DOUBTFUL: 2 samples of x, y (faster than sqrt(g L) = 22.1 m/s)" in result.stdout
    assert any("DOUBTFUL" in note for note in load_dataset("out").notes)


def test_rows_that_go_back_in_time_can_be_left_out(trial_import):
    result = trial_import(swapped(), mapping(time='column = "time"\nbackwards = "drop"'))
    assert result.exit_code == 0
    assert "2 rows that go back in time, left out" in result.stdout


def test_repeated_rows_are_left_out_and_told(trial_import):
    result = trial_import("\n".join([*ROWS[:30], ROWS[29], *ROWS[30:]]) + "\n")
    assert result.exit_code == 0
    assert "1 readings at a time that was there before, left out" in result.stdout


def test_a_folder_that_is_there_is_refused_unless_forced(trial_import, tmp_path):
    trial_import(TEXT)
    before = (tmp_path / "out/trajectories.csv").read_bytes()
    refused = trial_import(TEXT, None, "--dt", "2")
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    assert (tmp_path / "out/trajectories.csv").read_bytes() == before
    assert trial_import(TEXT, None, "--dt", "2", "--force").exit_code == 0
    assert load_dataset("out").dt == 2.0


def test_a_failed_import_with_force_leaves_the_old_data_set(trial_import, tmp_path):
    trial_import(TEXT)
    assert trial_import(with_cell(100, 3, "x"), None, "--force").exit_code == 2
    assert len(load_dataset("out")) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv", "mapping.toml", "out", "ship.toml"]


def test_force_never_replaces_a_folder_with_other_files(trial_import, tmp_path):
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", "thesis.tex", "years of work")
    result = trial_import(TEXT, None, "--force")
    assert result.exit_code == 2
    assert "holds more than a data set (thesis.tex)" in result.stderr
    assert (tmp_path / "out/thesis.tex").read_text() == "years of work"


def test_logs_inside_the_folder_to_replace_are_refused(trial_import, tmp_path):
    trial_import(TEXT)
    result = trial_import([tmp_path / "out/trajectories.csv"], None, "--force")
    assert result.exit_code == 2
    assert "lies in the folder" in result.stderr


def test_a_folder_that_cannot_be_written_is_one_message(trial_import, tmp_path):
    write(tmp_path, "file", "")
    result = trial_import(TEXT, None, "--out", "file/out")
    assert result.exit_code == 2
    assert "cannot write" in result.stderr


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_one_message(trial_import, tmp_path):
    (tmp_path / "closed").mkdir(mode=0o555)
    result = trial_import(TEXT, None, "--out", "closed/out")
    assert result.exit_code == 2
    assert "cannot write" in result.stderr


def test_an_interrupted_import_leaves_nothing(tmp_path):
    def work():
        with FolderWriter(tmp_path / "out") as writer:
            writer.add("a", np.arange(3.0), {"x": np.zeros(3)})
            assert list(tmp_path.iterdir()) == [writer.fresh]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("missing", ["--map", "--ship"])
def test_without_mapping_or_ship_the_next_step_is_told(tmp_path, monkeypatch, missing):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "log.csv", TEXT)
    write(tmp_path, "mapping.toml", mapping())
    given = {"--map": "mapping.toml", "--ship": "ship.toml"}
    arguments = [word for option, value in given.items() if option != missing for word in (option, value)]
    result = CliRunner().invoke(app, ["data", "import", "log.csv", *arguments])
    assert result.exit_code == 2
    assert f"{missing} is missing" in result.stderr
    assert "--propose" in result.stderr


def test_a_missing_log_or_ship_is_named(trial_import, tmp_path):
    assert "no.csv" in trial_import([tmp_path / "no.csv"]).stderr
    for name in ("a.dat", "b.dat", "c.txt"):
        (tmp_path / name).touch()
    assert f"is a folder; give the log files themselves, such as {tmp_path}/*.dat." in trial_import([tmp_path]).stderr
    (tmp_path / "ship.toml").unlink()
    write(tmp_path, "log.csv", TEXT)
    result = CliRunner().invoke(app, ["data", "import", "log.csv", "--map", "mapping.toml", "--ship", "ship.toml"])
    assert result.exit_code == 2
    assert "ship.toml" in result.stderr


def test_a_ship_file_of_no_ship_is_refused_before_anything_is_written(trial_import, tmp_path):
    result = trial_import(TEXT, ship=SHIP + "[propeller]\ndiameter = 2400.0\n")
    assert result.exit_code == 2
    assert "ship.toml: ship 'trial': propeller.diameter is 2400 m; accepted: up to 2 T = 6" in " ".join(
        result.stderr.split()
    )
    assert not (tmp_path / "out").exists()


def test_a_latitude_out_of_range_names_unit_and_format(trial_import):
    plan = mapping(
        body=channels("x", "y", lat='{ column = "north", unit = "deg" }', lon='{ column = "east", unit = "deg" }')
    )
    result = trial_import(TEXT, plan)
    assert result.exit_code == 2
    assert "'lat' reaches" in result.stderr


def test_a_source_without_its_file_is_named(trial_import, tmp_path):
    plan = (
        mapping()
        .replace("[time]", '[sources.a]\nfiles = "gps*"\n[sources.a.time]')
        .replace("[channels]", "[sources.a.channels]")
    )
    plan += (
        '[sources.b]\nfiles = "sonar*"\n[sources.b.time]\ncolumn = "t"\n[sources.b.channels]\n'
        'depth = { column = "d", unit = "m" }\n'
    )
    result = trial_import(TEXT, plan, name="gps.csv")
    assert result.exit_code == 2
    assert "no log for the source 'b'" in result.stderr


@pytest.mark.parametrize("kind", ["pipe", "device"])
@pytest.mark.parametrize("which", ["log.csv", "mapping.toml", "ship.toml"])
def test_what_is_no_regular_file_is_refused_and_not_waited_for(kind, which, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("log.csv", "mapping.toml", "ship.toml"):
        (tmp_path / name).write_text("t,x\n0,1\n" if name == "log.csv" else "")
    (tmp_path / "mapping.toml").write_text(
        'name = "a"\ndt = 1.0\n[time]\ncolumn = "t"\n[channels]\nx = {column = "x", unit = "m"}\n'
    )
    (tmp_path / "ship.toml").write_text('name = "toy"\nL = 50.0\nB = 8.0\nT = 3.0\nmass = 9e5\n')
    (tmp_path / which).unlink()
    os.mkfifo(tmp_path / which) if kind == "pipe" else (tmp_path / which).symlink_to("/dev/zero")
    result = CliRunner().invoke(
        app, ["data", "import", "log.csv", "--map", "mapping.toml", "--ship", "ship.toml", "--out", "out"]
    )
    assert result.exit_code == 2
    assert "not a regular file" in result.stderr or "mapping.toml" in result.stderr
