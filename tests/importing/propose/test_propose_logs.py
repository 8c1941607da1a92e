"""Proposals for logs that leave something open: options, partial mappings, several runs and vessels, words among
numbers, what cannot be known."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
import zipfile

import numpy as np
import pandas as pd
import pytest
from trial import SHIP, logged, motion, write
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset

T = np.arange(0.0, 90.0)


@pytest.fixture
def propose(tmp_path, monkeypatch):
    """Call it with logs and options; it returns the result and the draft, as text and as TOML."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "ship.toml", SHIP)

    def run(*logs, options=()):
        done = CliRunner().invoke(
            app, ["data", "import", *map(str, logs), "--propose", "draft.toml", "--force", *options]
        )
        text = (tmp_path / "draft.toml").read_text() if done.exit_code == 0 else ""
        return done, text, tomllib.loads(text)

    return run


def imported(*logs):
    done = CliRunner().invoke(
        app,
        ["data", "import", *map(str, logs), "--map", "draft.toml", "--ship", "ship.toml", "--out", "out", "--force"],
    )
    assert done.exit_code == 0, done.output
    return load_dataset("out")


def test_a_latin_1_log_is_read_and_the_encoding_can_be_given(propose, tmp_path):
    table = logged(T).rename(columns={"HDG": "Steuerkurs [°]"})
    log = write(tmp_path, "log.csv", table.to_csv(index=False).encode("latin-1"))
    done, _, plan = propose(log)
    assert "not UTF-8; read as Latin-1" in done.stdout
    assert plan["channels"]["psi"]["column"] == "Steuerkurs [°]"
    assert propose(log, options=["--encoding", "latin-1"])[2]["file"]["encoding"] == "latin-1"
    for name in ("utf-8", "utf-16", "rot13", "nonsense"):
        wrong, _, _ = propose(log, options=["--encoding", name])
        assert wrong.exit_code == 2, name
        assert "latin-1" in wrong.stderr


@pytest.mark.parametrize("name", ["--encoding", "--sheet", "--header"])
def test_options_of_the_draft_are_refused_without_it(propose, tmp_path, name):
    done = CliRunner().invoke(app, ["data", "import", "log.csv", name, "1"])
    assert done.exit_code == 2
    assert f"{name} serves --propose" in done.stderr


def test_a_header_row_that_is_given_is_taken(propose, tmp_path):
    table = logged(T)
    log = write(tmp_path, "log.csv", f"{','.join('abcdefghij')}\n{table.to_csv(index=False)}")
    assert propose(log, options=["--header", "2"])[2]["file"]["header"] == 2
    assert set(propose(log, options=["--header", "2"])[2]["channels"]) >= {"x", "y", "psi"}


def test_a_workbook_with_several_sheets_asks_for_one(propose, tmp_path):
    with pd.ExcelWriter(tmp_path / "log.xlsx") as book:
        logged(T).to_excel(book, index=False, sheet_name="run 1")
        logged(T).to_excel(book, index=False, sheet_name="run 2")
    done, _, _ = propose("log.xlsx")
    assert done.exit_code == 2
    assert "--sheet" in done.stderr
    assert propose("log.xlsx", options=["--sheet", "run 2"])[2]["file"]["sheet"] == "run 2"


def test_quiet_leaves_out_the_notes_and_not_what_was_written(propose, tmp_path):
    log = write(tmp_path, "log.csv", logged(T).assign(remark="calm"))
    loud, _, _ = propose(log)
    quiet, _, _ = propose(log, options=["-q"])
    assert "not taken" in loud.stdout
    assert "not taken" not in quiet.stdout
    assert "draft.toml" in quiet.stdout


def test_what_a_partial_mapping_says_is_kept_and_the_rest_is_drafted(propose, tmp_path):
    log = write(tmp_path, "log.csv", logged(T).rename(columns={"HDG": "A7", "rudder": "A8"}))
    write(tmp_path, "part.toml",
          'name = "mine"\nlicence = "ours"\n[split]\nwindow = 30.0\n[channels]\n'
          'psi = { column = "A7", unit = "deg" }\n'
          'delta = { column = "A8", unit = "deg", sign = "port" }\n')  # fmt: skip
    _, text, plan = propose(log, options=["--map", "part.toml"])
    assert (plan["name"], plan["licence"], plan["split"]["window"]) == ("mine", "ours", 30.0)
    assert plan["channels"]["delta"] == {"column": "A8", "unit": "deg", "sign": "port"}
    assert {"x", "y", "u", "v", "r", "n"} <= set(plan["channels"])
    assert "as given" in next(line for line in text.splitlines() if line.startswith("delta"))
    assert len(imported(log)) == 2


def test_a_partial_mapping_is_never_overwritten(propose, tmp_path):
    log = write(tmp_path, "log.csv", logged(T))
    write(tmp_path, "draft.toml", 'name = "mine"\n')
    assert propose(log, options=["--map", "draft.toml"])[0].exit_code == 2
    assert (tmp_path / "draft.toml").read_text() == 'name = "mine"\n'


def test_files_of_one_kind_are_recordings_also_where_one_has_a_column_more(propose, tmp_path):
    logs = [write(tmp_path, "a.csv", logged(T)), write(tmp_path, "b.csv", logged(T).assign(remark="calm"))]
    _, _, plan = propose(*logs)
    assert "sources" not in plan
    assert len(imported(*logs)) == 2


def test_a_channel_that_not_all_recordings_have_is_left_out(propose, tmp_path):
    logs = [write(tmp_path, "a.csv", logged(T)), write(tmp_path, "b.csv", logged(T).drop(columns="rpm"))]
    done, _, plan = propose(*logs)
    assert "n" not in plan["channels"]
    assert "is not in b.csv" in done.stdout
    assert len(imported(*logs)) == 2


def test_a_recording_under_other_heads_is_no_further_instrument(propose, tmp_path):
    logs = [write(tmp_path, "a.csv", logged(T)), write(tmp_path, "b.csv", logged(T).rename(columns={"HDG": "heading"}))]
    done, _, plan = propose(*logs)
    assert "sources" not in plan
    assert "b.csv: a recording with other columns than a.csv" in done.stdout


def test_a_column_of_runs(propose, tmp_path):
    table = pd.concat([logged(T).assign(**{"test no": k}) for k in (1, 2, 3)])
    log = write(tmp_path, "log.csv", table)
    _, _, plan = propose(log)
    assert plan["run"] == "test no"
    assert "backwards" not in plan["time"]
    assert len(imported(log)) == 3


def test_a_course_is_no_heading(propose, tmp_path):
    s = motion(T)
    east, north = (
        s["u"] * np.sin(s["psi"]) + s["v"] * np.cos(s["psi"]),
        s["u"] * np.cos(s["psi"]) - s["v"] * np.sin(s["psi"]),
    )
    table = pd.DataFrame({"t": T, "north": s["x"], "east": s["y"], "Kurs": np.rad2deg(np.arctan2(east, north)) % 360.0})
    done, _, plan = propose(write(tmp_path, "log.csv", table))
    assert "psi" not in plan["channels"]
    assert "it is the course, no heading" in " ".join(done.stdout.split())
    assert "MISSING: no column was taken for psi" in done.stdout


def test_a_word_that_may_be_heading_or_course_is_the_heading_where_it_leaves_the_track(propose, tmp_path):
    _, text, plan = propose(write(tmp_path, "log.csv", logged(T).rename(columns={"HDG": "Kurs"})))
    assert plan["channels"]["psi"]["column"] == "Kurs"
    assert "from the track's direction" in text


def test_a_unit_that_the_motion_contradicts_is_told_and_kept(propose, tmp_path):
    table = logged(T).rename(columns={"surge": "surge [m/s]"})  # it is in knots
    done, _, plan = propose(write(tmp_path, "log.csv", table))
    assert plan["channels"]["u"]["unit"] == "m/s"
    assert "NOT SURE: 'surge [m/s]' says m/s; the track says kn" in done.stdout


def test_units_that_no_head_names_come_from_the_motion(propose, tmp_path):
    _, _, plan = propose(write(tmp_path, "log.csv", logged(T)))
    assert {c: plan["channels"][c]["unit"] for c in ("psi", "u", "r")} == {"psi": "deg", "u": "kn", "r": "deg/min"}


def test_words_among_numbers_are_missing_readings(propose, tmp_path):
    table = logged(T).astype({"rpm": object})
    table.loc[[3, 50], "rpm"] = "---"
    log = write(tmp_path, "log.csv", table)
    _, _, plan = propose(log)
    assert plan["missing"] == ["---"]
    assert len(imported(log)) == 1


def test_a_word_far_down_in_the_log_is_found_by_the_trial(propose, tmp_path):
    t = np.arange(0.0, 21_000.0)
    table = pd.DataFrame({"t [s]": t, "north": t, "east": 0 * t, "heading [deg]": 0.0, "rpm": 90.0}).astype(
        {"rpm": object}
    )
    table.loc[20_500, "rpm"] = "out of range"
    done, _, plan = propose(write(tmp_path, "log.csv", table))
    assert plan["missing"] == ["out of range"]
    assert "'out of range' in 'rpm' is taken as a missing reading" in done.stdout


def test_the_pulse_width_of_two_motors_needs_what_full_means(propose, tmp_path):
    table = logged(T).drop(columns="rpm").assign(PWM_L=1600, PWM_R=1700)
    _, text, plan = propose(write(tmp_path, "log.csv", table))
    assert "n_c" not in plan["channels"]
    line = next(line for line in text.splitlines() if line.startswith("# n_c"))
    assert 'mean = ["PWM_L", "PWM_R"], unit = "pwm"' in line
    assert "MISSING" in line


def test_speed_through_the_water_is_not_taken(propose, tmp_path):
    done, _, plan = propose(write(tmp_path, "log.csv", logged(T).drop(columns=["surge", "sway"]).assign(STW=8.0)))
    assert not {"u", "sog"} & set(plan["channels"])
    assert "'STW' is a speed through the water" in done.stdout


def test_velocities_in_earth_axes_are_told(propose, tmp_path):
    done, _, plan = propose(
        write(tmp_path, "log.csv", logged(T).rename(columns={"surge": "Vn [m/s]", "sway": "Ve [m/s]"}))
    )
    assert not {"u", "v"} & set(plan["channels"])
    assert "velocities in earth axes" in done.stdout


def test_stamps_without_a_zone_beside_moments_are_told(propose, tmp_path):
    t = 1.7e9 + T
    gps = pd.DataFrame({"unix": t, "north": T, "east": 0 * T, "heading": 0.0})
    local = (pd.to_datetime(t, unit="s") + pd.Timedelta("1h")).strftime("%d.%m.%Y %H:%M:%S")
    done, _, _ = propose(
        write(tmp_path, "gps.csv", gps), write(tmp_path, "bridge.csv", pd.DataFrame({"Zeit": local, "Drehzahl": 90.0}))
    )
    assert "bridge.csv name no zone" in done.stdout
    assert "+1.00 h from the other" in " ".join(done.stdout.split())


def test_day_and_month_that_can_be_either_are_told(propose, tmp_path):
    for first, sure in (("05/04/2024", False), ("25/04/2024", True)):
        stamps = [f"{first} 10:{int(t) // 60:02d}:{int(t) % 60:02d}" for t in T]
        done, _, plan = propose(write(tmp_path, "log.csv", logged(T).assign(time=stamps)))
        assert plan["time"]["format"] == "%d/%m/%Y %H:%M:%S"
        assert ("day or month first" in done.stdout) is not sure


def test_a_decimal_or_thousands_mark_that_cannot_be_told_is_told(propose, tmp_path):
    table = pd.DataFrame(
        {
            "t": T.astype(int),
            "north": (4 * T).astype(int),
            "east": 0,
            "heading": 10,
            "rpm": [f"1.{90 + int(k) % 3:03d}" for k in T],
        }
    )
    done, _, plan = propose(write(tmp_path, "log.csv", table))
    assert "decimal or a thousands mark" in done.stdout
    assert "thousands" not in plan.get("file", {})


def test_thousands_are_seen_where_a_column_runs_over_1000(propose, tmp_path):
    n = 990.0 + T / 4
    table = pd.DataFrame(
        {
            "t": T.astype(int),
            "north": (4 * T).astype(int),
            "east": 0,
            "heading": 10,
            "rpm": [f"{v:,.0f}".replace(",", ".") for v in n],
        }
    )
    log = write(tmp_path, "log.csv", table.to_csv(index=False, sep=";"))
    _, _, plan = propose(log)
    assert plan["file"]["thousands"] == "."
    np.testing.assert_allclose(imported(log).runs[0].states[:, 6], np.round(n), atol=1.0)


@pytest.mark.parametrize(
    "order",
    [("north", "east", "HDG", "surge", "sway", "ROT", "rpm"), ("rpm", "ROT", "sway", "HDG", "east", "surge", "north")],
)
def test_columns_without_heads_are_known_by_the_motion(propose, tmp_path, order):
    """What does not take part in the motion, such as the shaft speed, stays with the reader."""
    t = np.arange(0.0, 240.0)
    log = write(tmp_path, "log.csv", logged(t)[["time", *order]].to_csv(index=False, header=False).encode())
    done, text, plan = propose(log)
    wanted = {"x": "north", "y": "east", "psi": "HDG", "u": "surge", "v": "sway", "r": "ROT"}
    assert {c: e["column"] for c, e in plan["channels"].items()} == {
        c: str(order.index(name) + 2) for c, name in wanted.items()
    }
    assert "NOT SURE: the columns have no heads" in done.stdout
    assert f'column "{order.index("rpm") + 2}": first values 110' in text
    run = imported(log).runs[0]
    np.testing.assert_allclose(run.states[:, 4], motion(run.t)["v"], atol=0.01)


def test_earth_fixed_velocities_without_heads_are_no_surge_and_sway(propose, tmp_path):
    t = np.arange(0.0, 240.0)
    table = logged(t)[["time", "north", "east", "HDG", "surge", "sway", "ROT"]]
    c, s = np.cos(np.deg2rad(table["HDG"])), np.sin(np.deg2rad(table["HDG"]))
    table["surge"], table["sway"] = table["surge"] * c - table["sway"] * s, table["surge"] * s + table["sway"] * c
    done, _, plan = propose(write(tmp_path, "log.csv", table.to_csv(index=False, header=False).encode()))
    assert set(plan["channels"]) == {"x", "y", "psi", "r"}
    assert "'5' and '6' are velocities in earth axes and not taken" in " ".join(done.stdout.split())
    assert 'velocities = "earth"' in done.stdout


def test_columns_without_heads_are_not_guessed_where_the_ship_does_not_turn(propose, tmp_path):
    t = np.arange(0.0, 240.0)
    table = pd.DataFrame(
        {"t": t, "x": 4.0 * t, "y": 0.01 * np.sin(t), "psi": 0.01 * np.cos(t / 9), "r": -0.001 * np.sin(t / 9)}
    )
    done, text, plan = propose(write(tmp_path, "log.csv", table.to_csv(index=False, header=False).encode()))
    assert not plan["channels"]
    assert "MISSING" in done.stdout
    assert 'column "3": first values' in text


def test_words_of_a_log_cannot_write_into_the_draft(propose, tmp_path):
    """A line break or an escape code in a head or a cell stays inside of its comment."""
    table = (
        logged(T)
        .rename(columns={"HDG": "heading\nlicence = 'theirs'\x1b[2J"})
        .assign(**{"note\n[split]\ngap = 9": "calm\n[antenna]\nx = 1"})
    )
    table.to_parquet(tmp_path / "log.parquet")
    done, text, plan = propose("log.parquet")
    assert plan["channels"]["psi"]["column"] == "heading\nlicence = 'theirs'\x1b[2J"
    assert not {"licence", "antenna"} & set(plan)
    assert plan["split"]["gap"] == 3.0
    assert "\x1b" not in text + done.stdout
    assert len(imported("log.parquet")) == 1


def test_sources_of_a_partial_mapping_keep_their_names_and_patterns(propose, tmp_path):
    table = logged(T)
    gps = write(tmp_path, "gps_1.csv", table[["time", "north", "east"]])
    bridge = write(tmp_path, "bridge.csv", table[["time", "HDG", "rpm", "rudder"]].rename(columns={"rudder": "A4"}))
    write(tmp_path, "part.toml",
        '[sources.gnss]\nfiles = "gps*"\n[sources.other]\nfiles = "bridge*"\n'
        '[sources.other.channels]\n'
          'delta = { column = "A4", unit = "deg", sign = "port" }\n')  # fmt: skip
    _, _, plan = propose(gps, bridge, options=["--map", "part.toml"])
    assert {name: source["files"] for name, source in plan["sources"].items()} == {"gnss": "gps*", "other": "bridge*"}
    assert set(plan["sources"]["gnss"]["channels"]) == {"x", "y"}
    assert plan["sources"]["other"]["channels"]["delta"]["sign"] == "port"
    assert set(plan["sources"]["other"]["channels"]) == {"psi", "n", "delta"}
    np.testing.assert_allclose(imported(gps, bridge).runs[0].states[:, 7], -0.2 * np.sin(T / 20.0), atol=0.01)


def test_a_time_of_a_partial_mapping_that_does_not_fit_is_one_message(propose, tmp_path):
    log = write(tmp_path, "log.csv", logged(T))
    for clock in ('column = "gone"', 'column = "time"\nformat = "%H:%M"', 'column = "time"\nformat = "nonsense"'):
        write(tmp_path, "part.toml", f"[time]\n{clock}\n")
        done, _, _ = propose(log, options=["--map", "part.toml"])
        assert done.exit_code == 2, clock
        assert "[time] of the partial mapping does not fit" in done.stderr


def test_json_is_one_document(propose, tmp_path):
    done, _, _ = propose(write(tmp_path, "log.csv", logged(T)), options=["--json"])
    document = json.loads(done.stdout)
    assert document["mapping"] == "draft.toml"
    assert any("Tried with the import" in line for line in document["remarks"])


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("channels = 3", "channels"), ("[channels]\npsi = 3", "psi"), ("file = 3", "file"), ("sources = 3", "sources"),
        ("time = 3", "time"),
        ("split = 3", "split"), ("name = 3", "name"), ("dt = 'x'", "dt"), ("[file]\nheader = 'x'", "header"),
        ("[time]\ncolum = 't'", "'column'"),
        ("[channels]\npsy = { column = 'HDG', unit = 'deg' }", "psy"),
        ("[channels]\npsi = { column = 'HDG', unit = "
         "'grad' }", "grad"),
        ("x = ", "part.toml"),
    ],
)  # fmt: skip
def test_a_partial_mapping_of_wrong_keys_or_kinds_is_one_message(propose, tmp_path, body, told):
    log = write(tmp_path, "log.csv", logged(T))
    write(tmp_path, "part.toml", f"{body}\n")
    done, _, _ = propose(log, options=["--map", "part.toml"])
    assert done.exit_code == 2
    assert told in done.stderr
    assert not (tmp_path / "draft.toml").exists()


def test_a_workbook_without_a_sheet_is_one_message(propose, tmp_path):
    path = tmp_path / "log.xlsx"
    pd.DataFrame({"t": [0.0, 1.0]}).to_excel(path, index=False)
    with zipfile.ZipFile(path) as packed:
        parts = {name: packed.read(name) for name in packed.namelist()}
    parts["xl/workbook.xml"] = re.sub(rb"<sheets>.*</sheets>", b"<sheets></sheets>", parts["xl/workbook.xml"])
    with zipfile.ZipFile(path, "w") as packed:
        for name, text in parts.items():
            packed.writestr(name, text)
    done, _, _ = propose(path)
    assert done.exit_code == 2
    assert "has no sheet" in done.stderr


def test_the_import_can_be_pasted_into_a_shell(propose, tmp_path):
    log = write(tmp_path, "log.csv", logged(T))
    done, _, _ = propose(log)
    shown = done.stdout.split("then:", 1)[1]
    words = ["shipbench", "data", "import", str(log), "--map", "draft.toml", "--ship", "ship.toml", "--out", "my_trial"]
    assert shlex.split(shown.replace("\\\n", " ")) == words
    assert all(line.endswith("\\") for line in shown.strip().splitlines()[:-1])
