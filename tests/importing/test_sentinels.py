"""Readings that stand for "not available": known ones are taken as missing, each in its channel, and reported; readings
that may be real are kept."""

from __future__ import annotations

import numpy as np
import pytest
from trial import channels, logged, mapping

from shipbench.data.base import load_dataset
from shipbench.importing.sentinels import beyond_a_turn, not_available

DEG, KNOT = np.pi / 180.0, 1852.0 / 3600.0
T = np.arange(0.0, 60.0, 0.5)


def found(name: str, readings: list[float], factor: float) -> tuple[list[int], list[int]]:
    """Rows that are missing, rows that are doubtful."""
    masks, doubtful = not_available(name, np.array(readings, float), factor)
    missing = sorted(int(k) for mask in masks.values() for k in np.flatnonzero(mask))
    return missing, np.flatnonzero(doubtful).tolist()


@pytest.mark.parametrize(
    ("name", "readings", "factor", "missing"),
    [
        ("psi", [34, 35, 511, 511, 36], DEG, [2, 3]),
        ("psi", [3400, 3500, 5110, 3500], 0.1 * DEG, [2]),
        ("psi", [34 * DEG, 8.919, 36 * DEG], 1.0, [1]),
        ("psi", [340, 655.35, 9999, -999, 350], DEG, [1, 2, 3]),
        ("cog", [34.4, 34.4, 360, 360, 34.5], DEG, [2, 3]),
        ("sog", [9.7, 102.3, 9.7], KNOT, [1]),
        ("sog", [97, 1023, 97], 0.1 * KNOT, [1]),
        ("sog", [5.0, 52.6277, 5.1], 1.0, [1]),
        ("r", [-5, -4, -128, -3], DEG / 60.0, [2]),
        ("lat", [52.0, 52.0, 91.0, 0.0, 52.0], DEG, [2, 3]),
        ("lon", [4.0, 181.0, 4.0], DEG, [1]),
        ("x", [5, 10, -999, 15, 20], 1.0, [2]),
        ("u", [5.0, -999.0 * KNOT, 5.0], 1.0, [1]),
        ("n", [90, 92, -999, 90], 1.0, [2]),
        ("n", [90, 90, -999, 90], 1.0, [2]),
        ("delta", [5, 10, 99.9, 327.67, 5], DEG, [2, 3]),
        ("depth", [20, -999, 20.5], 1.0, [1]),
    ],
)
def test_known_readings_are_missing(name, readings, factor, missing):
    assert found(name, readings, factor) == (missing, [])


@pytest.mark.parametrize(
    ("name", "readings", "factor"),
    [
        ("psi", [500, 505, 511, 515], DEG),  # counted on over north
        ("cog", [359.9, 0.1, 360, 359.9, 0.0], DEG),
        ("r", [-100, -110, -128, -130, -120], DEG / 60.0),
        ("lon", [0.01, 0.005, 0.0, -0.005], DEG),
        ("x", [-990, -994.5, -999, -1003], 1.0),
        ("n", [505, 511, 512], 1.0),
        ("n", [800, 990, 999, 1010], 1.0),
        ("n", [90, 99.8, 99.9, 90], 1.0),
    ],
)
def test_the_same_numbers_are_readings_where_the_others_lead_to_them(name, readings, factor):
    assert found(name, readings, factor) == ([], [])


def test_a_fill_value_that_may_be_a_reading_is_doubtful():
    assert found("n_c", [500, 500, 999, 500], 1.0) == ([], [])
    assert found("n_c", [0, 0, 999, 0], 1.0) == ([], [2])


def test_headings_far_beyond_a_turn_are_told_from_headings_that_are_counted_on(trial_import):
    def rows(degrees: list[float]) -> list[int]:
        return np.flatnonzero(beyond_a_turn(np.radians(degrees))).tolist()

    assert rows([350, 355, 800, 800, 5, 10, -400, 12]) == [2, 3, 6]
    assert rows([350, 359, 362, 500, 640, 700, 10, 20]) == []  # turned to; then another run begins
    assert rows([700, 720, 730]) == []
    assert rows([359, 1, 358, 2]) == []
    table = logged(T)
    table.loc[40:42, "HDG"] = 872.5
    assert "DOUBTFUL: 3 readings of psi jump beyond -180 to 360 deg" in trial_import(table).stdout


def test_a_heading_that_is_counted_on_is_read_and_its_reach_reported(trial_import):
    table = logged(T)
    table["HDG"] += 1080.0
    told = " ".join(trial_import(table).stdout.split())
    assert 'psi reaches 1298 deg: taken as counted on over north. If it is in steps of 0.01 deg: unit = "cdeg"' in told
    assert "DOUBTFUL" not in told


def test_headings_of_511_are_bridged_and_reported(trial_import):
    clean = logged(T)
    table = clean.copy()
    table.loc[40:43, "HDG"] = 511.0
    result = trial_import(table)
    assert result.exit_code == 0, result.output
    assert "4 readings of psi that are 511 deg (AIS: not available), taken as missing" in result.stdout
    run = load_dataset("out").runs[0]
    trial_import(clean, None, "--force")
    assert (
        np.abs(run.states[:, 2] - load_dataset("out").runs[0].states[:, 2]).max() < 0.02
    )  # rad; a heading of 511 deg is off by more than 1 rad


def test_clean_readings_are_not_reported(trial_import):
    told = trial_import(logged(T)).stdout
    assert "missing" not in told
    assert "DOUBTFUL" not in told


def test_missing_of_a_channel_holds_for_it_alone(trial_import):
    table = logged(T)
    table["rpm"] = 777.0
    table.loc[20:25, "HDG"] = 777.0
    plan = mapping(body=channels(psi='{ column = "HDG", unit = "deg", missing = [777] }'))
    assert trial_import(table, plan).exit_code == 0
    run = load_dataset("out").runs[0]
    assert len(load_dataset("out")) == 1
    np.testing.assert_allclose(run.states[:, 6], 777.0)
    assert np.rad2deg(run.states[:, 2]).max() < 300.0


def test_the_code_of_another_channel_in_the_list_of_the_source_is_kept_and_reported(trial_import):
    table = logged(T)
    table["rpm"] = np.round(500.0 + np.arange(len(T)) / 5.0)
    table.loc[20:22, "HDG"] = 511.0
    result = trial_import(table, mapping(top="missing = [511]"))
    assert result.exit_code == 0, result.output
    assert "readings of n that are 511, kept" in result.stdout
    assert len(load_dataset("out")) == 1


def test_an_empty_list_makes_every_number_a_reading(trial_import):
    table = logged(T)
    table.loc[20:22, "rudder"] = 99.9
    told = trial_import(table).stdout
    assert "readings of delta that are 99.9 (a fill value), taken as missing" in told
    plan = mapping(body=channels(delta='{ column = "rudder", unit = "deg", missing = [] }'))
    assert trial_import(table, plan, "--force").exit_code == 0
    assert (
        np.rad2deg(load_dataset("out").runs[0].states[:, 7]).max() > 50.0
    )  # three readings of 99.9 deg on a grid of twice their step
