"""Time stamps of every kind that loggers write, read to the second that they mean."""

from __future__ import annotations

import datetime

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from trial import logged, mapping, write

from shipbench import load_dataset
from shipbench.importing.clock import is_absolute, is_daily, to_seconds
from shipbench.importing.mapping import Clock

T = np.arange(0.0, 60.5, 0.5)
START = pd.Timestamp("2025-05-04 10:00:00", tz="UTC").timestamp()


def seconds(cells, **clock):
    """Times of one column of text, or of typed cells."""
    column = cells if isinstance(cells, pa.Array) else pa.array(cells)
    return to_seconds(
        Clock(column="t", **clock), [column], lambda name: np.array([float(c) for c in column.to_pylist()]), "log", []
    )


def two(first, second, **clock):
    columns = {"a": pa.array(first), "b": pa.array(second)}
    return to_seconds(
        Clock(columns=("a", "b"), **clock),
        list(columns.values()),
        lambda name: columns[name].to_numpy().astype(float),
        "log",
        [],
    )


@pytest.mark.parametrize(
    "form", ["%H:%M:%S %d-%m-%Y", "%d-%m-%Y %H:%M:%S", "%H:%M:%S %m-%d-%Y", "%H:%M %z%d-%m-%Y", "%H.%M.%S %d+%Y%m"]
)
def test_what_ends_like_an_offset_is_none_and_the_zone_is_used(form):
    moment = datetime.datetime(2025, 1, 15, 10, 0, 0, tzinfo=datetime.UTC)
    if "%z" in form:
        assert seconds([moment.strftime(form)], format=form)[0] == moment.timestamp()
    else:
        assert seconds([moment.strftime(form)], format=form, zone="Europe/Amsterdam")[0] == moment.timestamp() - 3600.0
        assert seconds([moment.strftime(form)], format=form)[0] == moment.timestamp()


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S%z", "%Y-%m-%dT%H:%M:%SZ", "%d.%m.%Y %H:%M:%S UTC"])
def test_a_format_with_a_zone_of_its_own_refuses_another(trial_import, form):
    result = trial_import(logged(T), mapping(time=f'column = "time"\nformat = "{form}"\nzone = "Europe/Berlin"'))
    assert result.exit_code == 2
    assert "Remove `zone`" in result.stderr


@pytest.mark.parametrize(
    "form",
    [
        "%d/%m/%Y %H:%M:%S.%f",
        "%d/%m/%Y %H:%M:%S,%f",
        "%Y%m%d %H%M%S.%f",
        "%H:%M:%S.%f %d-%m-%Y",
        "%Y-%m-%dT%H:%M:%S.%fZ",
    ],
)
def test_a_stamp_without_its_fraction_is_a_whole_second(form):
    whole = form.replace(".%f", "").replace(",%f", "")
    moments = [datetime.datetime(2025, 5, 4, 10, 0, 0) + datetime.timedelta(seconds=0.5 * k) for k in range(5)]
    texts = [m.strftime(form if m.microsecond else whole) for m in moments]
    np.testing.assert_allclose(seconds(texts, format=form), START + 0.5 * np.arange(5), atol=1e-6)


@pytest.mark.parametrize(
    "cells", [[330.0, 330.5, 95959.0, 100000.0], ["330", "330.5", "95959", "100000.00"], [330, 330, 95959, 100000]]
)
@pytest.mark.parametrize("form", ["hhmmss", "%H%M%S.%f"])
def test_times_of_day_without_leading_zeros(cells, form):
    got = seconds(cells if isinstance(cells[0], str) else pa.array(cells), format=form)
    np.testing.assert_allclose(got, [210.0, 210.0 if isinstance(cells[1], int) else 210.5, 35999.0, 36000.0], atol=1e-9)
    assert is_daily(Clock(column="t", format=form))


def test_dates_of_digits_without_leading_zeros():
    assert seconds(["40525 95959.5", "40525 0"], format="%d%m%y %H%M%S.%f").tolist() == [START - 0.5, START - 36000.0]


@pytest.mark.parametrize("value", [126060.0, 250000.0, -1.0, 129900.0])
def test_numbers_that_are_no_time_of_day_are_refused(trial_import, value):
    table = logged(T).assign(time=100000.0 + np.arange(len(T)) % 60)
    table.loc[7, "time"] = value
    result = trial_import(table, mapping(time='column = "time"\nformat = "hhmmss"'))
    assert result.exit_code == 2
    assert f"has {value:g}" in result.stderr


@pytest.mark.parametrize(("unit", "per_second"), [("ns", 1e9), ("us", 1e6)])
def test_counted_nanoseconds_and_microseconds(trial_import, unit, per_second):
    for form, zero in ((unit, 0.0), (f"unix_{unit}", START)):
        stamps = [f"{round((zero + t) * per_second)}" for t in T]
        result = trial_import(
            logged(T).assign(time=stamps), mapping(time=f'column = "time"\nformat = "{form}"'), "--force"
        )
        assert result.exit_code == 0, result.output
        run = load_dataset("out").runs[0]
        assert run.t[-1] - run.t[0] == pytest.approx(60.0)


def test_seconds_and_nanoseconds_in_two_columns(trial_import):
    table = logged(T).assign(secs=(START + T).astype(int), nsecs=(T % 1 * 1e9).astype(int))
    for form in ("unix+ns", "unix"):
        result = trial_import(table, mapping(time=f'columns = ["secs", "nsecs"]\nformat = "{form}"'), "--force")
        assert result.exit_code == 0, result.output
        assert "every 0.5 s" in result.stdout
    refused = trial_import(
        table.assign(nsecs=2_000_000_000), mapping(time='columns = ["secs", "nsecs"]\nformat = "unix+ns"'), "--force"
    )
    assert "accepted: 0 to 999999999 ns" in refused.stderr
    refused = trial_import(
        table.rename(columns={"nsecs": "part"}), mapping(time='columns = ["secs", "part"]\nformat = "unix"'), "--force"
    )
    assert "'unix+ns' for seconds and nanoseconds" in refused.stderr


@pytest.mark.parametrize(
    "texts",
    [
        ["0 days 00:00:00.500000", "0 days 00:00:01", "1 days 00:00:00"], ["0:00:00.5", "0:00:01", "24:00:00"],
        ["00:00:00,5", "00:00:01,0", "1 day, 0:00:00"],
    ],
)  # fmt: skip
@pytest.mark.parametrize("form", ["timedelta", "s"])
def test_durations_written_as_text(texts, form):
    assert seconds(texts, format=form).tolist() == [0.5, 1.0, 86400.0]
    assert not is_absolute(Clock(column="t", format=form))


def test_durations_before_the_start_and_texts_that_are_none():
    assert seconds(["-1 days +23:59:59.5", "-0:00:00.5", None, "NaT"], format="timedelta").tolist()[:2] == [-0.5, -0.5]
    with pytest.raises(Exception, match="'5' is no duration"):
        seconds(["0:00:01", "5"], format="timedelta")


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_durations_of_arrow(unit):
    column = pa.array([datetime.timedelta(seconds=1), datetime.timedelta(seconds=90), None], pa.duration(unit))
    for form in ("timedelta", "s"):
        np.testing.assert_array_equal(seconds(column, format=form), [1.0, 90.0, np.nan])
    with pytest.raises(Exception, match="accepted for it: 'timedelta'"):
        seconds(column, format="unix")


@pytest.mark.parametrize("shown", ["[h]:mm:ss", "[h]:mm:ss.0", "h:mm:ss"])
def test_excel_durations(trial_import, tmp_path, shown):
    openpyxl = pytest.importorskip("openpyxl")
    table = logged(T)
    book = openpyxl.Workbook()
    book.active.append(list(table.columns))
    for row in table.itertuples(index=False):
        book.active.append([row[0] / 86_400.0, *row[1:]])
        book.active.cell(book.active.max_row, 1).number_format = shown
    book.save(tmp_path / "log.xlsx")
    for form in ("timedelta", "s"):
        result = trial_import([tmp_path / "log.xlsx"], mapping(time=f'column = "time"\nformat = "{form}"'), "--force")
        assert result.exit_code == 0, result.output
        assert load_dataset("out").runs[0].t[-1] == pytest.approx(60.0)


@pytest.mark.parametrize("date", [pa.timestamp("ns"), pa.timestamp("ms"), pa.date32(), pa.date64(), pa.string()])
@pytest.mark.parametrize("time", ["time32", "time64", "duration", "text", "stamp"])
@pytest.mark.parametrize("order", [1, -1])
def test_typed_columns_of_date_and_time(date, time, order):
    day = datetime.datetime(2025, 5, 4)
    dates = pa.array([day, day], pa.timestamp("ns")).cast(pa.date32()).cast(date)
    clock = [datetime.time(10, 0, 0), datetime.time(10, 0, 0, 500_000)]
    since = [datetime.timedelta(hours=10), datetime.timedelta(hours=10, seconds=0.5)]
    times = {
        "time32": lambda: pa.array(clock, pa.time32("ms")), "time64": lambda: pa.array(clock, pa.time64("us")),
        "duration": lambda: pa.array(since),
        "text": lambda: pa.array(["10:00:00", "10:00:00.5"]),
        "stamp": lambda: pa.array([datetime.datetime(1900, 1, 1) + s for s in since]),
    }[time]()  # fmt: skip
    if pa.types.is_string(date) and (order < 0 or time in ("duration", "stamp")):
        pytest.skip("text is joined in its order")
    assert two(*[dates, times][::order], format="iso").tolist() == [START, START + 0.5]


def test_a_column_of_dates_that_holds_the_time_too_is_refused():
    stamps = pa.array([datetime.datetime(2025, 5, 4, 10, 0, 1)])
    with pytest.raises(Exception, match="hold no date without a time of day"):
        two(stamps, ["10:00:00"], format="iso")


@pytest.mark.parametrize(
    ("form", "stamp"),
    [("iso", "2016-12-31T23:59:60Z"), ("%d/%m/%Y %H:%M:%S.%f", "31/12/2016 23:59:60.25"), ("%H%M%S", "235960")],
)
def test_a_leap_second_is_the_next_midnight(form, stamp):
    expected = 86400.0 if is_daily(Clock(column="t", format=form)) else 1483228800.0 + 0.25 * ("." in stamp)
    assert seconds([stamp], format=form)[0] == expected
    assert seconds(["2016-12-31T10:00:00.5960Z"], format="iso")[0] == 1483178400.596


def test_an_hour_that_the_change_of_clocks_repeats_is_refused(trial_import):
    stamps = pd.date_range("2024-10-27 02:59:00", periods=len(T), freq="500ms").strftime("%d/%m/%Y %H:%M:%S.%f")
    result = trial_import(
        logged(T).assign(time=stamps),
        mapping(time='column = "time"\nformat = "%d/%m/%Y %H:%M:%S.%f"\nzone = "Europe/Berlin"'),
    )
    assert result.exit_code == 2
    assert "no one meaning in the zone 'Europe/Berlin'" in result.stderr


def test_local_time_beside_utc_is_merged_at_the_same_moment(trial_import, tmp_path):
    times = pd.Timestamp("2025-01-15 09:00:00") + pd.to_timedelta(T, unit="s")
    table = logged(T)
    gps = write(
        tmp_path,
        "gps.csv",
        table[["north", "east", "HDG"]].assign(unix=times.astype("datetime64[us]").astype("int64") / 1e6),
    )
    stamps = (times + pd.Timedelta(hours=1)).strftime("%H:%M:%S.%f %d-%m-%Y")
    bridge = write(tmp_path, "bridge.csv", table[["rpm", "rudder"]].assign(clock=stamps))
    plan = """
name = "trial"
dt = 1.0
[sources.gps]
files = "gps.csv"
time = { column = "unix", format = "unix" }
channels.x = { column = "north", unit = "m" }
channels.y = { column = "east", unit = "m" }
channels.psi = { column = "HDG", unit = "deg" }
[sources.bridge]
files = "bridge.csv"
time = { column = "clock", format = "%H:%M:%S.%f %d-%m-%Y", zone = "Europe/Amsterdam" }
channels = { n = { column = "rpm", unit = "rpm" }, delta = { column = "rudder", unit = "deg" } }
"""
    result = trial_import([gps, bridge], plan)
    assert result.exit_code == 0, result.output
    run = load_dataset("out").runs[0]
    assert (run.meta.from_, run.meta.to) == ("2025-01-15T09:00:00.000Z", "2025-01-15T09:01:00.000Z")
    np.testing.assert_allclose(run.states[:, 7], 0.2 * np.sin(run.t / 20.0), atol=0.003)
