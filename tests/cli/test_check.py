"""`shipbench data check` as a user meets it: what it prints and writes, exit codes, and one message for files that
cannot be read."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from shipbench.cli.app import app
from shipbench.reports.recorded import RUNS, thinned
from shipbench.suites.checks.clean_sets import base_set
from shipbench.suites.checks.faults import FAULTS
from shipbench.suites.checks.suite import write_planted

SHIP, SEED = "kcs", 311
BY_NAME = {fault.name: fault for fault in FAULTS}


def check(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["data", "check", *map(str, arguments)])


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> Path:
    return write_planted(base_set(SHIP, SEED), None, SEED, tmp_path_factory.mktemp("sets") / "clean")


@pytest.fixture(scope="module")
def table(clean) -> pd.DataFrame:
    return pd.read_parquet(clean / "trajectories.parquet")


@pytest.fixture
def folder(clean, tmp_path) -> Callable[..., Path]:
    """A folder with the clean set's TOML files and this table: bytes under a name, or a frame as CSV."""

    def write(content: bytes | pd.DataFrame, name: str = "trajectories.csv") -> Path:
        for toml in ("dataset.toml", "ship.toml"):
            (tmp_path / toml).write_bytes((clean / toml).read_bytes())
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.to_csv(index=False).encode())
        return tmp_path

    return write


def test_a_clean_set_exits_0_and_says_so(clean):
    result = check(clean)
    assert result.exit_code == 0, result.output
    assert "Findings: 0 errors, 0 warnings, 0 notes." in result.stdout
    assert "dataset.toml" not in result.stdout


def test_an_error_exits_1_with_figures_and_the_line(tmp_path):
    result = check(write_planted(base_set(SHIP, SEED), BY_NAME["rudder in degrees"], SEED, tmp_path / "set"))
    assert result.exit_code == 1
    assert "Findings: 1 error, 0 warnings, 0 notes." in result.stdout
    assert 'delta = "deg"' in result.stdout


def test_a_warning_exits_0(tmp_path):
    result = check(write_planted(base_set(SHIP, SEED), BY_NAME["yaw rate late"], SEED, tmp_path / "set"))
    assert result.exit_code == 0
    assert "0 errors, 1 warning, 0 notes" in result.stdout
    assert "[delay]" in result.stdout


def test_json_is_one_document_and_out_holds_a_picture_of_each_finding(tmp_path):
    folder = write_planted(base_set(SHIP, SEED), BY_NAME["outliers of x"], SEED, tmp_path / "set")
    document = json.loads(check(folder, "--json", "--out", tmp_path / "out").stdout)
    (finding,) = document["findings"]
    assert finding["kind"] == "outliers"
    assert finding["evidence"]["samples"] == 4
    assert tomllib.loads(document["lines"]) == tomllib.loads(finding["line"])
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "check.html",
        "findings.json",
        "dataset_lines.toml",
        "01-outliers.png",
    }
    assert (tmp_path / "out" / "01-outliers.png").read_bytes()[:4] == b"\x89PNG"
    assert json.loads((tmp_path / "out" / "findings.json").read_text()) == document


def test_pictures_of_an_earlier_check_do_not_stay(clean, tmp_path):
    check(
        write_planted(base_set(SHIP, SEED), BY_NAME["outliers of x"], SEED, tmp_path / "set"), "--out", tmp_path / "out"
    )
    check(clean, "--out", tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.png"))


def test_the_printed_lines_laid_at_the_end_of_dataset_toml_heal(tmp_path):
    folder = write_planted(base_set(SHIP, SEED), BY_NAME["speeds in knots"], SEED, tmp_path / "set")
    printed = check(folder).stdout.split("each finding:\n")[1]
    lines = "\n".join(row.removeprefix("  ") for row in printed.splitlines())
    with (folder / "dataset.toml").open("a") as file:
        file.write("\n" + lines + "\n")
    assert "0 errors, 0 warnings, 0 notes" in check(folder).stdout


def test_apply_writes_the_lines_keeps_comments_and_the_old_file_and_leaves_nothing_to_find(tmp_path):
    folder = write_planted(base_set(SHIP, SEED), BY_NAME["speeds in knots"], SEED, tmp_path / "set")
    old = "# my ship\n" + (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(old)
    assert check(folder, "--apply").exit_code == 1
    assert (folder / "dataset.toml.before-check").read_text() == old
    text = (folder / "dataset.toml").read_text()
    assert text.startswith("# my ship\n")
    assert tomllib.loads(text)["units"] == {"u": "kn", "v": "kn"}
    assert "0 errors, 0 warnings, 0 notes" in check(folder, "--apply").stdout
    assert sorted(p.name for p in folder.iterdir()) == [
        "dataset.toml",
        "dataset.toml.before-check",
        "ship.toml",
        "trajectories.parquet",
    ]


def test_apply_on_a_registered_set_exits_2():
    result = check("harbour90", "--apply")
    assert result.exit_code == 2
    assert "no dataset.toml to apply lines to" in result.stderr


def test_lines_name_runs_with_any_character(table, folder):
    odd = 'a "b" ]= [x] é'
    names = table["trajectory"].where(table["trajectory"] != "run03", odd)
    jumped = table.assign(trajectory=names)
    at = jumped.index[names == odd]
    jumped.loc[at[60:], "psi"] += 0.3
    path = folder(jumped.to_csv(index=False).encode())
    (finding,) = json.loads(check(path, "--json").stdout)["findings"]
    assert list(tomllib.loads(finding["line"])["runs"]) == [odd]


HOSTILE: dict[str, Callable[[pd.DataFrame], tuple[bytes, str]]] = {
    "empty": lambda t: (b"", "trajectories.csv"),
    "header only": lambda t: (",".join(t.columns).encode() + b"\n", "trajectories.csv"),
    "binary": lambda t: (bytes(range(256)) * 40, "trajectories.csv"),
    "zeros": lambda t: (b"\0" * 5000, "trajectories.csv"),
    "no parquet": lambda t: (b"PAR1" + b"\0" * 500, "trajectories.parquet"),
    "truncated gzip": lambda t: (gzip.compress(t.head(500).to_csv(index=False).encode())[:5000], "trajectories.csv.gz"),
    "no x": lambda t: (t.head(50).drop(columns="x").to_csv(index=False).encode(), "trajectories.csv"),
    "u empty": lambda t: (t.head(50).assign(u=None).to_csv(index=False).encode(), "trajectories.csv"),
    "u infinite": lambda t: (t.head(50).assign(u="inf").to_csv(index=False).encode(), "trajectories.csv"),
    "u huge": lambda t: (t.head(50).assign(u=1e300).to_csv(index=False).encode(), "trajectories.csv"),
    "t huge": lambda t: (t.head(50).assign(t=t["t"] * 1e200).to_csv(index=False).encode(), "trajectories.csv"),
    "t text": lambda t: (t.head(50).assign(t="now").to_csv(index=False).encode(), "trajectories.csv"),
    "one row": lambda t: (t.head(1).to_csv(index=False).encode(), "trajectories.csv"),
    "x twice": lambda t: (t.head(50).to_csv(index=False).replace(",x,y,", ",x,x,", 1).encode(), "trajectories.csv"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_table_that_cannot_be_read_exits_2_with_one_message_and_writes_nothing(kind, table, folder, tmp_path):
    result = check(folder(*HOSTILE[kind](table)), "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("file", "content"),
    [("dataset.toml", b"\xff\xfe\x00"), ("dataset.toml", b""), ("dataset.toml", b"name = "), ("ship.toml", b'L = "x"'),
     ("dataset.toml", b'name = "a"\ndt = 0\nactuators = "measured"'),
     ("dataset.toml", b'name = "a"\ndt = 1e9999\n'
                      b'actuators = "measured"')],
)  # fmt: skip
def test_a_description_that_cannot_be_read_exits_2(file, content, table, folder, tmp_path):
    path = folder(table.head(50))
    (path / file).write_bytes(content)
    result = check(path, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert file in result.stderr
    assert not (tmp_path / "out").exists()


def test_an_out_that_is_a_file_exits_2_and_keeps_it(clean, tmp_path):
    (tmp_path / "out").write_text("mine")
    result = check(clean, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("rows", [2, 5, 121])
def test_few_samples_are_no_fault_and_no_failure(rows, table, folder):
    assert check(folder(table.head(rows))).exit_code == 0


def test_a_table_that_ends_inside_a_row_is_a_finding_of_that_row(table, folder):
    whole = table.head(300).to_csv(index=False)
    result = check(folder(whole[: whole.rindex(",", 0, -200)].encode()), "--json")
    assert result.exit_code == 1
    assert {f["kind"] for f in json.loads(result.stdout)["findings"]} <= {"NaN tail", "text", "missing values"}


def test_a_ship_that_never_moves_is_no_fault(table, folder):
    still = table.assign(
        **dict.fromkeys(
            ("x", "y", "psi", "u", "v", "r", "n", "n_c", "delta", "delta_c", "F_b", "F_s", "F_b_c", "F_s_c"), 0.0
        )
    )
    assert "0 errors, 0 warnings, 0 notes" in check(folder(still)).stdout


def test_a_channel_that_never_changes_is_compared_without_a_warning(table, folder):
    assert check(folder(table.assign(v=1.0, r=1.0))).exit_code in (0, 1)


def page_of(folder: Path, out: Path) -> str:
    result = check(folder, "--out", out)
    assert f"Written: {out / 'check.html'} and" in result.stdout, result.output
    return (out / "check.html").read_text()


def plots_in(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)[1])


def test_the_page_says_the_verdict_the_line_and_begins_at_the_run_concerned(tmp_path):
    folder = write_planted(base_set(SHIP, SEED), BY_NAME["outliers of x"], SEED, tmp_path / "set")
    (finding,) = json.loads(check(folder, "--json").stdout)["findings"]
    page = page_of(folder, tmp_path / "out")
    assert "1 error, 0 warnings" in page or "0 errors, 1 warning" in page
    assert finding["text"] in html.unescape(page)
    assert html.unescape(page).count(f"<pre>{finding['line']}</pre>") == 2  # with the finding, and among all lines
    data = plots_in(page)
    assert [r["name"] for r in data["runs"]] == sorted(finding["runs"])
    assert data["runs"][data["start"]]["name"] == finding["runs"][0]
    assert data["runs"][data["start"]]["note"] == "outliers"
    assert {s["name"] for s in data["series"]} == {"recorded", "command"}


def test_a_page_of_many_runs_draws_some_and_says_how_many(clean, tmp_path):
    page = page_of(clean, tmp_path / "out")
    assert "No fault was found" in page
    assert f"{RUNS} of " in page or len(plots_in(page)["runs"]) < RUNS
    assert '<section id="lines"' not in page


def test_names_on_the_page_stay_text(table, folder, tmp_path):
    odd = "</script><script>alert(1)</script>"
    names = table["trajectory"].where(table["trajectory"] != "run03", odd)
    jumped = table.assign(trajectory=names)
    jumped.loc[jumped.index[names == odd][60:], "psi"] += 0.3
    path = folder(jumped.to_csv(index=False).encode())
    toml = path / "dataset.toml"
    toml.write_text(
        "licence = '<script>alert(2)</script>'\n" + re.sub(r"^licence = .*$", "", toml.read_text(), flags=re.MULTILINE)
    )
    page = page_of(path, tmp_path / "out")
    assert "<script>alert" not in page
    assert "&lt;/script&gt;&lt;script&gt;alert(1)" in page
    assert "&lt;script&gt;alert(2)" in page
    assert plots_in(page)["runs"][0]["name"] == odd
    policy = re.search(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)[1]
    for script in re.findall(r"<script>(.*?)</script>", page, re.DOTALL):
        assert base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() in policy
    assert "unsafe-eval" not in policy


def test_thinning_keeps_a_single_wrong_sample_and_the_breaks():
    values = np.sin(np.linspace(0.0, 9.0, 50_000))
    values[31_337], values[40_000] = 9.0, np.nan
    kept = thinned(np.column_stack([values]), 1000)
    assert len(kept) <= 1100
    assert {0, 31_337, 40_000, 49_999} <= set(kept.tolist())
    assert (np.diff(kept) > 0).all()
