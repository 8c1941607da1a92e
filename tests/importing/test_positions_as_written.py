"""Latitude and longitude as logs write them: letters, degrees with minutes, both in one cell."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from trial import channels, logged, mapping, motion

from shipbench.data.base import load_dataset

T = np.arange(0.0, 60.0, 1.0)
LAT, LON = -33.8, -70.2
METRES = 6_371_000.0 * np.pi / 180.0


def track() -> tuple[np.ndarray, np.ndarray]:
    """Signed degrees of the ship's track, to a millimetre within a few hundred metres of its beginning."""
    s = motion(T)
    return LAT + s["x"] / 110_900.0, LON + s["y"] / (111_413.0 * np.cos(np.radians(LAT)))


def nmea(degrees: np.ndarray, digits: int) -> list[str]:
    size = np.abs(degrees)
    return [f"{int(d):0{digits}d}{60.0 * (d % 1.0):08.5f}" for d in size]


def seconds(degrees: float) -> str:
    """Degrees, minutes and seconds; 59.9999 seconds become 60.000."""
    whole, minutes = divmod(abs(degrees) * 60.0, 60.0)
    return f"{whole:.0f}°{int(minutes)}'{minutes % 1.0 * 60.0:.3f}"


def log(**extra) -> pd.DataFrame:
    return logged(T).assign(**extra)


def plan(lat: str, lon: str, tables: str = "") -> str:
    return mapping(body=channels("x", "y", lat=lat, lon=lon), tables=tables)


def end_of_track(result) -> np.ndarray:
    assert result.exit_code == 0, result.output
    return load_dataset("out").runs[0].states[-1, :2]


TRUTH = np.array([motion(T)["x"][-1], motion(T)["y"][-1]])
COLUMN = '{{ column = "{}", unit = "{}"{} }}'


@pytest.mark.parametrize(
    ("lat", "lon", "unit"),
    [
        (lambda a: [f"{-v:.8f} S" for v in a], lambda o: [f"W{-v:.8f}" for v in o], "deg"),
        (lambda a: [f"{v + 'S'}" for v in nmea(a, 2)], lambda o: [f"{v}W" for v in nmea(o, 3)], "ddmm.mmmmN"),
        (lambda a: [f"-{v}" for v in nmea(a, 2)], lambda o: [f"-{v}" for v in nmea(o, 3)], "ddmm.mmmm"),
        (
            lambda a: [f"{int(-v)}°{(-v % 1) * 60:.6f}'S" for v in a],
            lambda o: [f"{int(-v)}° {(-v % 1) * 60:.6f}' W" for v in o],
            "deg",
        ),
        (
            lambda a: [f"S {int(-v)} {(-v % 1) * 60:.6f}" for v in a],
            lambda o: [f"{int(-v)} {(-v % 1) * 60:.6f} W" for v in o],
            "deg",
        ),
        (lambda a: [seconds(v) + '"S' for v in a], lambda o: [seconds(v) + "W" for v in o], "deg"),
        (lambda a: np.round(a * 1e7).astype(int), lambda o: np.round(o * 1e7).astype(int), "1e-7 deg"),
        (
            lambda a: [f"{v:.8f}S" for v in a],
            lambda o: [f"{v:.8f}W" for v in o],
            "deg",
        ),  # minus and letter say the same
    ],
)
def test_positions_in_a_cell(trial_import, lat, lon, unit):
    a, o = track()
    result = trial_import(
        log(lat=lat(a), lon=lon(o)), plan(COLUMN.format("lat", unit, ""), COLUMN.format("lon", unit, ""))
    )
    np.testing.assert_allclose(end_of_track(result), TRUTH, atol=0.5)


@pytest.mark.parametrize("letters", ["SW", ["south", "West"]])
def test_letters_in_columns_of_their_own(trial_import, letters):
    a, o = track()
    table = log(lat=nmea(a, 2), ns=letters[0], lon=nmea(o, 3), ew=letters[1])
    told = plan(
        COLUMN.format("lat", "ddmm.mmmm", ', hemisphere = "ns"'),
        COLUMN.format("lon", "ddmm.mmmm", ', hemisphere = "ew"'),
    )
    np.testing.assert_allclose(end_of_track(trial_import(table, told)), TRUTH, atol=0.5)


def test_letters_that_are_not_read_are_refused_with_the_line_that_reads_them(trial_import):
    a, o = track()
    table = log(lat=-a, lon=-o, **{"N/S": "S", "E/W": "W"})
    refused = trial_import(table, plan(COLUMN.format("lat", "deg", ""), COLUMN.format("lon", "deg", "")))
    assert refused.exit_code == 2
    assert "column 'N/S' says S" in refused.stderr
    assert 'lat = { column = "lat", unit = "deg", hemisphere = "N/S" }' in refused.stderr
    kept = trial_import(
        table, plan(COLUMN.format("lat", "deg", ', sign = "north"'), COLUMN.format("lon", "deg", ', sign = "east"'))
    )
    assert kept.exit_code == 0, kept.output
    signed = log(lat=a, lon=o, **{"N/S": "S", "E/W": "W"})
    assert (
        trial_import(
            signed, plan(COLUMN.format("lat", "deg", ""), COLUMN.format("lon", "deg", "")), "--force"
        ).exit_code
        == 0
    )


@pytest.mark.parametrize(
    "form",
    [
        "{:.8f} {:.8f}",
        "({:.8f}, {:.8f})",
        "{:.8f};{:.8f}",
        "POINT ({1:.8f} {0:.8f})",
        "S {2:.8f} W {3:.8f}",
        "{2:.8f} S, {3:.8f} W",
    ],
)
def test_both_in_one_cell(trial_import, form):
    table = log(GPS=[form.format(a, o, -a, -o) for a, o in zip(*track(), strict=True)])
    lat, lon = (2, 1) if form.startswith("POINT") else (1, 2)
    told = plan(COLUMN.format("GPS", "deg", f", part = {lat}"), COLUMN.format("GPS", "deg", f", part = {lon}"))
    np.testing.assert_allclose(end_of_track(trial_import(table, told)), TRUTH, atol=0.5)


def test_both_in_one_cell_without_part_says_part(trial_import):
    table = log(GPS=["{:.8f} {:.8f}".format(*pair) for pair in zip(*track(), strict=True)])
    refused = trial_import(table, plan(COLUMN.format("GPS", "deg", ""), COLUMN.format("GPS", "deg", "")))
    assert refused.exit_code == 2
    assert "part = 1 in lat and part = 2 in lon" in refused.stderr


@pytest.mark.parametrize(
    ("lat", "entry", "told"),
    [
        ("52°4737.8", COLUMN.format("lat", "deg", ""), "not a number"),
        ("5275.50", COLUMN.format("lat", "ddmm.mmmm", ""), "minutes, accepted up to 60"),
        ("5215.50", COLUMN.format("lat", "deg", ""), 'unit = "ddmm.mmmm"'),
        (520_000_000, COLUMN.format("lat", "deg", ""), 'unit = "1e-7 deg"'),
        ("52.0E", COLUMN.format("lat", "deg", ""), "accepted for lat: N and S"),
        ("-52.0N", COLUMN.format("lat", "deg", ""), "contradicts the letter N"),
        ("5215.50", COLUMN.format("lat", "ddmm.mmmmN", ""), "needs a letter"),
        ("52.0S", COLUMN.format("lat", "deg", ', sign = "south"'), "Remove sign"),
        (
            "52.0",
            COLUMN.format("lat", "deg", ', hemisphere = "rpm"'),
            "names the hemisphere 110.0; accepted for lat: N and S",
        ),
        ("52.0S", COLUMN.format("lat", "deg", ', hemisphere = "ns"'), "Remove hemisphere"),
        ("52.0", COLUMN.format("lat", "deg", ', hemisphere = "ns", sign = "south"'), "Remove sign"),
    ],
)
def test_a_position_that_contradicts_itself_is_refused(trial_import, lat, entry, told):
    refused = trial_import(log(lat=lat, ns="S", lon=4.0), plan(entry, COLUMN.format("lon", "deg", "")))
    assert refused.exit_code == 2
    assert told in refused.stderr


def test_readings_without_a_letter_are_left_out_and_reported(trial_import):
    a, o = track()
    ns = ["S"] * len(T)
    ns[5:8] = [None] * 3
    told = plan(COLUMN.format("lat", "deg", ', hemisphere = "ns"'), COLUMN.format("lon", "deg", ""))
    result = trial_import(log(lat=-a, ns=ns, lon=o), told.replace("[time]", "[split]\ngap = 9.0\n[time]"))
    assert "3 readings of lat without a letter in 'ns', left out" in result.stdout
    np.testing.assert_allclose(end_of_track(result), TRUTH, atol=0.5)


@pytest.mark.parametrize(("lat", "advised"), [("52.0", False), ("5200.0", True)])
def test_minutes_are_advised_for_the_longitude_where_the_latitude_has_them(trial_import, lat, advised):
    body = channels("x", "y", lon=COLUMN.format("lon", "deg", ""), lat=COLUMN.format("lat", "deg", ""))
    told = trial_import(log(lon="407.6", lat=lat), mapping(body=body)).stderr
    assert "'lon' reaches 407.6 deg" in told
    assert ("ddmm.mmmm" in told) == advised
