"""One simulated trial, written as loggers of several countries and kinds write it: the draft imports to the truth,
without a word changed."""

from __future__ import annotations

import tomllib
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from every_day import every
from trial import SHIP, motion, write
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset
from shipbench.signals import STATES

T = np.arange(0.0, 240.0)
START = pd.Timestamp("2024-11-23 09:58:30")
SECONDS = pd.to_timedelta(T, "s")
LAT, LON = -33.8, -70.2
KN = 3600.0 / 1852.0
DEG = np.rad2deg(1.0)


def truth(t: np.ndarray = T) -> dict[str, np.ndarray]:
    """States of the trial at times t [s]; the shaft speed passes 1000 rpm."""
    return motion(t) | {"n": 980.0 + 40.0 * np.sin(t / 40.0)}


def log(time: object, names: dict[str, str], scale: dict[str, float] | None = None, t: np.ndarray = T) -> pd.DataFrame:
    """A table: a time column of the head in names["t"], and each channel under its head, in SI times `scale`."""
    s = truth(t)
    factor = {"psi": DEG, "delta": DEG, "r": 60 * DEG} | (scale or {})
    columns = {names["t"]: time}
    for channel, head in names.items():
        if channel == "psi":
            columns[head] = np.round(s["psi"] * factor["psi"] % (360.0 * factor["psi"] / DEG), 3)
        elif channel != "t":
            columns[head] = np.round(s[channel] * factor.get(channel, 1.0), 4)
    return pd.DataFrame(columns)


PLAIN = {"t": "t [s]", "x": "x [m]", "y": "y [m]", "psi": "HDG [deg]", "u": "u [m/s]", "v": "v [m/s]",
    "r": "ROT [deg/min]", "n": "RPM",
         "delta": "rudder [deg]"}  # fmt: skip


def text(table: pd.DataFrame, sep: str = ",", decimal: str = ".", encoding: str = "utf-8", before: str = "") -> bytes:
    return (before + table.to_csv(index=False, sep=sep, decimal=decimal)).encode(encoding)


def clocked(time: object, head: str = "time") -> bytes:
    return text(log(time, PLAIN | {"t": head}))


def positions() -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude of the trial [deg], on the tangent plane of WGS84 at the first."""
    s, lat = truth(), np.deg2rad(LAT)
    e2 = 0.0066943799901413165
    n = 6378137.0 / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    m = n * (1 - e2) / (1 - e2 * np.sin(lat) ** 2)
    return LAT + s["x"] / m * DEG, LON + s["y"] / (n * np.cos(lat)) * DEG


def placed(**columns: object) -> bytes:
    """The plain log with these columns instead of x and y."""
    return text(log(T, PLAIN).drop(columns=["x [m]", "y [m]"]).assign(**columns))


def minutes(degrees: np.ndarray, digits: int) -> list[str]:
    """Degrees and minutes as NMEA writes them."""
    return [f"{int(abs(d)):0{digits}d}{(abs(d) % 1) * 60:08.5f}" for d in degrees]


def german() -> bytes:
    table = log(T,
        {"t": "Zeit [s]", "x": "Hochwert [m]", "y": "Rechtswert [m]", "psi": "Kurs rechtweisend [°]",
            "u": "Längsgeschwindigkeit [Knoten]",
                    "v": "Quergeschwindigkeit [Knoten]", "r": "Drehrate [°/min]", "n": "Drehzahl [U/min]",
                    "delta": "Ruderlage [Grad]"},
                {"u": KN, "v": KN})  # fmt: skip
    cells = table.map(lambda v: f"{v:,.3f}".translate(str.maketrans(",.", ".,")))
    return text(cells, sep=";", encoding="latin-1", before="Messfahrt;Schiff A;;;;;;;\n")


def thousands() -> bytes:
    table = log(T, PLAIN | {"n": "Shaft speed (1/min)"})
    return text(table.assign(**{"Shaft speed (1/min)": [f"{v:,.0f}" for v in table["Shaft speed (1/min)"]]}))


def course(names: tuple[str, ...], encoding: str = "utf-8") -> bytes:
    """Speed and course over ground instead of u and v."""
    s = truth()
    east, north = (
        s["u"] * np.sin(s["psi"]) + s["v"] * np.cos(s["psi"]),
        s["u"] * np.cos(s["psi"]) - s["v"] * np.sin(s["psi"]),
    )
    t, x, y, psi, sog, cog, r, n, delta = names
    table = log(T, {"t": t, "x": x, "y": y, "psi": psi, "r": r, "n": n, "delta": delta})
    table[sog] = np.round(np.hypot(north, east) * KN, 4)
    table[cog] = np.round(np.rad2deg(np.arctan2(east, north)) % 360, 3)
    return text(table, sep=";", decimal=",", encoding=encoding)


FRENCH = ("temps [s]", "nord [m]", "est [m]", "cap (°)", "vitesse fond (nœuds)", "route fond (°)",
    "taux de giration (°/min)", "régime [tr/min]",
          "angle de barre (degrés)")  # fmt: skip
SPANISH = ("tiempo (s)", "norte (m)", "este (m)", "rumbo (°)", "velocidad (nudos)", "rumbo sobre el fondo (grados)",
    "velocidad de giro (grados/min)",
           "revoluciones (rpm)", "timón (grados)")  # fmt: skip
NORWEGIAN = ("tid [s]", "nord [m]", "øst [m]", "kurs [°]", "fart over grunn [knop]", "kurs over grunn [°]",
    "svinghastighet [°/min]",
             "turtall [o/min]", "rorvinkel [grader]")  # fmt: skip


def seconds_and_nanoseconds() -> bytes:
    t = np.arange(0.0, 240.0, 0.4)
    table = log(1_746_352_800 + t.astype(int), PLAIN | {"t": "stamp.secs"}, t=t)
    table.insert(1, "stamp.nsecs", np.round((t - t.astype(int)) * 1e9).astype(int))
    return text(table)


def fractions_left_out() -> bytes:
    t = np.arange(0.0, 240.0, 0.5)
    return text(
        log(
            [f"{s:%d.%m.%Y %H:%M:%S}" + (".5" if k % 2 else "") for k, s in enumerate(START + pd.to_timedelta(t, "s"))],
            PLAIN,
            t=t,
        )
    )


def quaternion() -> bytes:
    half = truth()["psi"] / 2
    parts = {f"orientation.{k}": v for k, v in zip("xyzw", (0 * T, 0 * T, np.sin(half), np.cos(half)), strict=True)}
    return text(log(T, {k: v for k, v in PLAIN.items() if k != "psi"}).assign(**parts))


def two_shafts() -> bytes:
    table = log(T, PLAIN)
    return text(table.drop(columns="RPM").assign(**{"rpm port": table["RPM"] - 3, "rpm stbd": table["RPM"] + 3}))


def blanks(names: bool) -> bytes:
    table = log(T, PLAIN)
    rows = ["  ".join(f"{v:12.5f}" for v in row) for row in table.to_numpy()]
    heads = ["  ".join(c.replace(" ", "_") for c in table.columns)] if names else []
    return "\n".join(["Basin 3", "Z10/10", *heads, *rows, ""]).encode()


def preamble() -> bytes:
    table = log(T, PLAIN)
    heads = [c.split(" [")[0] for c in table.columns]
    units = ["s", "m", "m", "deg", "m/s", "m/s", "deg/min", "rpm", "deg"]
    body = table.to_csv(index=False, header=False)
    return f"Vessel: A\nLogger 3.2\n\n{','.join(heads)}\n{','.join(units)}\n\n{body}".encode()


def nameless_units() -> bytes:
    s = truth()
    table = pd.DataFrame({"time": T, "north": s["x"], "east": s["y"], "heading": s["psi"], "u": s["u"], "v": s["v"],
            "r": s["r"] * DEG, "rpm": s["n"],
                          "rudder": s["delta"] * DEG})  # fmt: skip
    return text(table.round(5))


def mirrored() -> bytes:
    """A yaw rate that counts to port, without a word about it, and x to the east."""
    table = log(T, PLAIN)
    return text(
        table.rename(columns={"x [m]": "y [m]", "y [m]": "x [m]"}).assign(**{"ROT [deg/min]": -table["ROT [deg/min]"]})
    )


def from_east() -> bytes:
    table = log(T, PLAIN).drop(columns=["x [m]", "y [m]"])
    lat, lon = positions()
    return text(table.assign(**{"HDG [deg]": 90.0 - truth()["psi"] * DEG, "Latitude": lat, "Longitude": lon}))


STAMPS = START + SECONDS
LATS, LONS = positions()
CSV: dict[str, Callable[[], bytes]] = {
    "german, thousands with points, Latin-1, preamble": german,
    "english thousands in quotes": thousands,
    "french, speed and course over ground": lambda: course(FRENCH),
    "spanish, one word for heading and course": lambda: course(SPANISH, "cp1252"),
    "norwegian": lambda: course(NORWEGIAN),
    "UTF-16 with tabs": lambda: text(log(T, PLAIN), sep="\t", encoding="utf-16"),
    "unix": lambda: clocked(STAMPS.astype("datetime64[ns]").astype("int64") / 1e9),
    "unix_ms": lambda: clocked(STAMPS.astype("datetime64[ns]").astype("int64") // 10**6, "timestamp"),
    "unix_ns": lambda: clocked(STAMPS.astype("datetime64[ns]").astype("int64"), "%time"),
    "us": lambda: clocked((T * 1e6).astype(int), "TimeUS"),
    "milliseconds without a unit": lambda: clocked((T * 1e3).astype(int)),
    "seconds and nanoseconds": seconds_and_nanoseconds,
    "fractions left out": fractions_left_out,
    "hhmmss without leading zeros": lambda: clocked([int(f"{s:%H%M%S}") for s in START - pd.Timedelta("9h") + SECONDS]),
    "timedelta": lambda: clocked([str(s) for s in SECONDS]),
    "day first, month by no doubt": lambda: clocked(STAMPS.strftime("%d/%m/%Y %H:%M:%S")),
    "twelve hours": lambda: clocked((STAMPS + pd.Timedelta("2h")).strftime("%m/%d/%Y %I:%M:%S %p")),
    "month by name": lambda: clocked(STAMPS.strftime("%d-%b-%Y %H:%M:%S")),
    "offset from UTC": lambda: clocked(STAMPS.strftime("%Y-%m-%d %H:%M:%S +0200")),
    "date and time of day in two columns": lambda: text(
        log(STAMPS.strftime("%H:%M:%S"), PLAIN | {"t": "Time"}).assign(Date=STAMPS.strftime("%d.%m.%Y"))
    ),
    "ddmm.mmmm with columns of hemispheres": lambda: placed(lat=minutes(LATS, 2), ns="S", lon=minutes(LONS, 3), ew="W"),
    "degrees with letters in the cell": lambda: placed(lat=[f"{-v:.7f} S" for v in LATS],
        lon=[f"{-v:.7f} W" for v in LONS]),
    "1e-7 degrees": lambda: placed(lat=np.round(LATS * 1e7).astype(int), lon=np.round(LONS * 1e7).astype(int)),
    "both in one cell": lambda: placed(GPS=[f"{a:.7f}, {b:.7f}" for a, b in zip(LATS, LONS, strict=True)]),
    "west counted as positive": lambda: placed(Latitude=LATS, Longitude=-LONS),
    "quaternion": quaternion,
    "two shafts": two_shafts,
    "centidegrees": lambda: text(log(T, PLAIN | {"psi": "hdg"},
            {"psi": 100 * DEG}).assign(hdg=lambda d: d["hdg"].round().astype(int))),
    "rudder in percent of 35 degrees": lambda: text(log(T, PLAIN | {"delta": "rudder [%]"}, {"delta": DEG / 0.35})),
    "runs of blanks": lambda: blanks(True),
    "preamble and row of units": preamble,
    "no units": nameless_units,
    "axes exchanged, yaw rate to port": mirrored,
    "heading from east, counter-clockwise": from_east,
}  # fmt: skip


def grouped(mark: str, decimal: str) -> bytes:
    """Shaft speed with a mark between groups of three digits, and the decimal mark of its country."""
    cells = [f"{v:,.1f}".replace(".", "D").replace(",", mark).replace("D", decimal) for v in truth()["n"]]
    return text(log(T, PLAIN).assign(RPM=cells), sep=";", decimal=decimal)


def stamped(stamps: list[str], head: str = "time", **columns: object) -> bytes:
    return text(log(stamps, PLAIN | {"t": head}).assign(**columns))


def with_commas_before_fractions() -> bytes:
    t = np.arange(0.0, 240.0, 0.5)
    stamps = [f"{s:%d.%m.%Y %H:%M:%S},{s.microsecond // 1000:03d}" for s in START + pd.to_timedelta(t, "s")]
    return text(log(stamps, PLAIN, t=t), sep=";", decimal=",")


def ardupilot() -> bytes:
    table = log((T * 1e6).astype(int), PLAIN | {"t": "TimeUS", "psi": "Yaw"}, {"psi": 100 * DEG}).drop(
        columns=["x [m]", "y [m]"]
    )
    return text(
        table.assign(
            Yaw=table["Yaw"].round().astype(int),
            Lat=np.round(LATS * 1e7).astype(int),
            Lng=np.round(LONS * 1e7).astype(int),
        )
    )


def east_north_up() -> bytes:
    half = (np.pi / 2 - truth()["psi"]) / 2
    turn = {f"orientation.{k}": v for k, v in zip("xyzw", (0 * T, 0 * T, np.sin(half), np.cos(half)), strict=True)}
    table = log(T, {k: v for k, v in PLAIN.items() if k not in ("psi", "x", "y")})
    return text(table.assign(**turn, Latitude=LATS, Longitude=LONS))


def renewed_each_second() -> bytes:
    """Ten rows a second, positions in one of them."""
    t = np.arange(0.0, 240.0, 0.1).round(1)
    table = log(t, PLAIN, t=t)
    table.loc[np.arange(len(t)) % 10 != 0, ["x [m]", "y [m]"]] = np.nan
    return text(table)


def sexagesimal(degrees: np.ndarray, letter: str) -> list[str]:
    return [f"{int(-d)}°{(-d % 1) * 60:.5f}'{letter}" for d in degrees]


GERMAN = ("Uhrzeit [s]", "Nord [m]", "Ost [m]", "Kreiselkurs [°]", "Fahrt über Grund [kn]", "Kurs über Grund [°]",
    "Wendegeschwindigkeit [°/min]",
          "Propellerdrehzahl [min-1]", "Ruderwinkel [°]")  # fmt: skip
FRENCH_TOO = ("heure [s]", "x nord [m]", "y est [m]", "cap gyro [°]", "vitesse [nds]", "route [°]",
    "vitesse de lacet [°/min]",
              "tours hélice [tr/min]", "safran [°]")  # fmt: skip
SPANISH_TOO = ("hora [s]", "norte [m]", "este [m]", "proa [°]", "velocidad sobre fondo [nudos]",
    "rumbo sobre fondo [°]", "razón de giro [°/min]",
               "régimen del motor [rpm]", "ángulo de pala [°]")  # fmt: skip
NORWEGIAN_TOO = (
    "Tid [s]",
    "nord [m]",
    "aust [m]",
    "Heading [°]",
    "Fart [knop]",
    "Kurs [°]",
    "ROT [°/min]",
    "Turtall [rpm]",
    "Ror [°]",
)
CSV |= {
    "apostrophes": lambda: grouped("'", "."),
    "narrow blanks and decimal commas": lambda: grouped("\u202f", ","),
    "commas before fractions of a second": with_commas_before_fractions,
    "hhmmss over midnight": lambda: stamped([f"{s:%H%M%S}" for s in STAMPS + pd.Timedelta("14h")]),
    "the date and time of NMEA": lambda: stamped([f"{s:%H%M%S}.00" for s in STAMPS],
        date=[f"{s:%d%m%y}" for s in STAMPS]),
    "one number for date and time": lambda: stamped([f"{s:%Y%m%d%H%M%S}" for s in STAMPS], "timestamp"),
    "seconds and nanoseconds of ROS 2": lambda: stamped(
        [str(1_746_352_800 + int(t)) for t in T], "header.stamp.sec", **{"header.stamp.nanosec": 0}
    ),
    "nanoseconds from zero": lambda: clocked((T * 1e9).astype("int64"), "t_ns"),
    "minutes": lambda: clocked(T / 60.0, "time [min]"),
    "days of Excel": lambda: clocked([f"{45000.4 + t / 86400:.9f}" for t in T], "Datum Zeit"),
    "days of MATLAB": lambda: clocked([f"{739000.4 + t / 86400:.9f}" for t in T], "datenum"),
    "minutes and seconds": lambda: clocked([f"{int(t) // 60:02d}:{int(t) % 60:02d}.0" for t in T]),
    "ddmm.mmmm with letters": lambda: placed(lat=[m + "S" for m in minutes(LATS, 2)],
        lon=[m + "W" for m in minutes(LONS, 3)]),
    "degrees and minutes with their marks": lambda: placed(lat=sexagesimal(LATS, "S"), lon=sexagesimal(LONS, "W")),
    "longitude before latitude in one cell": lambda: placed(**{"lon/lat": [f"{b:.7f} {a:.7f}" for a,
            b in zip(LATS, LONS, strict=True)]}),
    "points of WKT": lambda: placed(geom=[f"POINT ({b:.7f} {a:.7f})" for a, b in zip(LATS, LONS, strict=True)]),
    "coordinates in radians, without a word": lambda: placed(lat=np.deg2rad(LATS).round(10),
        lon=np.deg2rad(LONS).round(10)),
    "the integers of ArduPilot": ardupilot,
    "quaternion from east": east_north_up,
    "positions in one row of ten": renewed_each_second,
    "UTM": lambda: text(log(T,
            {"t": "t", "psi": "HDG", "u": "u", "v": "v", "r": "ROT", "n": "RPM", "delta": "rudder"}).assign(
        Northing=truth()["x"] + 5_760_000, Easting=truth()["y"] + 570_000)),
    "a mark of comment before the heads": lambda: b"# " + text(log(T, PLAIN)),
    "a footer": lambda: text(log(T, PLAIN)) + b"# end of log\n",
    "german instruments": lambda: course(GERMAN),
    "french instruments": lambda: course(FRENCH_TOO),
    "spanish instruments": lambda: course(SPANISH_TOO),
    "norwegian instruments": lambda: course(NORWEGIAN_TOO),
}  # fmt: skip


@pytest.fixture
def there_and_back(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "ship.toml", SHIP)

    def run(name: str, *options: str):
        done = CliRunner().invoke(app, ["data", "import", name, "--propose", "draft.toml", *options])
        assert done.exit_code == 0, done.output
        assert "FAILS" not in done.output
        back = CliRunner().invoke(
            app, ["data", "import", name, "--map", "draft.toml", "--ship", "ship.toml", "--out", "out"]
        )
        assert back.exit_code == 0, (tmp_path / "draft.toml").read_text() + back.output
        return load_dataset("out"), (tmp_path / "draft.toml").read_text()

    return run


def check_truth(run) -> None:
    """The run is the trial, within what resampling and rounding cost."""
    t = run.t - run.t[0]
    want, states = truth(t), {name: run.states[:, k] for k, name in enumerate(STATES)}
    assert 235.0 < t[-1] < 240.0
    for name in ("x", "y"):
        np.testing.assert_allclose(states[name] - states[name][0], want[name] - want[name][0], atol=1.5, err_msg=name)
    for name, tolerance in (("psi", 0.02), ("u", 0.05), ("v", 0.05), ("r", 0.002), ("n", 3.0), ("delta", 0.01)):
        np.testing.assert_allclose(states[name], want[name], atol=tolerance, err_msg=name)


@pytest.mark.parametrize("name", every(3, CSV))
def test_the_draft_imports_to_the_truth(there_and_back, tmp_path, name):
    (tmp_path / "log.csv").write_bytes(CSV[name]())
    data, draft = there_and_back("log.csv")
    assert len(data) == 1, draft
    check_truth(data.runs[0])


@pytest.mark.parametrize("kind", ["date and time", "duration"])
def test_a_workbook(there_and_back, tmp_path, kind):
    table = log(T, PLAIN)
    if kind == "duration":
        table["t [s]"] = SECONDS
        table = table.rename(columns={"t [s]": "elapsed"})
        with pd.ExcelWriter(tmp_path / "log.xlsx") as book:
            table.to_excel(book, index=False, startrow=3, sheet_name="motions")
            pd.DataFrame({"remarks": ["calm"]}).to_excel(book, index=False, sheet_name="notes")
            for row in book.sheets["motions"].iter_rows(min_row=5, max_col=1):
                row[0].number_format = "[h]:mm:ss"
    else:
        table = table.drop(columns="t [s]").assign(Date=[s.date() for s in STAMPS], Time=[s.time() for s in STAMPS])
        table.to_excel(tmp_path / "log.xlsx", index=False, sheet_name="motions")
    check_truth(there_and_back("log.xlsx", "--sheet", "motions")[0].runs[0])


def test_typed_times_of_parquet(there_and_back, tmp_path):
    log(STAMPS, PLAIN | {"t": "stamp"}).to_parquet(tmp_path / "log.parquet")
    check_truth(there_and_back("log.parquet")[0].runs[0])


def test_fields_of_a_matlab_struct(there_and_back, tmp_path):
    from scipy.io import savemat

    s = truth()
    savemat(tmp_path / "log.mat",
        {"ship": {"time": T, "pos_n": s["x"], "pos_e": s["y"], "heading_deg": s["psi"] * DEG, "u": s["u"], "v": s["v"],
                                            "r_deg_s": s["r"] * DEG, "shaft_rpm": s["n"],
                                            "rudder_angle_deg": s["delta"] * DEG}})  # fmt: skip
    check_truth(there_and_back("log.mat")[0].runs[0])


def test_a_table_without_heads_with_a_partial_mapping(there_and_back, tmp_path):
    (tmp_path / "log.csv").write_bytes(blanks(False))
    plan = {"x": ("2", "m"), "y": ("3", "m"), "psi": ("4", "deg"), "u": ("5", "m/s"), "v": ("6", "m/s"),
        "r": ("7", "deg/min"), "n": ("8", "rpm"),
            "delta": ("9", "deg")}  # fmt: skip
    lines = [f'{c} = {{ column = "{k}", unit = "{unit}" }}' for c, (k, unit) in plan.items()]
    write(tmp_path, "partial.toml", "\n".join(['name = "basin"', "dt = 2.0", "[channels]", *lines]))
    data, draft = there_and_back("log.csv", "--map", "partial.toml")
    check_truth(data.runs[0])
    kept = tomllib.loads(draft)
    assert (kept["name"], kept["dt"], kept["time"]["column"], kept["file"]["header"], kept["file"]["skip"]) == (
        "basin",
        2.0,
        "1",
        0,
        2,
    )
