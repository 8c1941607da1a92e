"""Free-running tests of a 3 m Esso Osaka model: measured runs (CC BY-NC-SA 4.0, not distributed here: downloaded, or
the user's own copy).

Source: github.com/NAOE-5thLab/FRT-DS-ESSO, Osaka University; Wakita et al. (2022), Miyauchi et al. (2022).
"""

from __future__ import annotations

import math
import os
import zlib
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..records import Dataset, Run
from ..regular_files import open_regular
from ..run_meta import RunMeta
from ..ship import Propeller, Rudder, Ship, Wind
from ..signals import COMMANDS, DELTA, PSI, N, R, U, V, X, Y
from .base import DatasetPart, public_folder
from .public import PublicData, find

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = {
    X: "x_position_mid [m]", Y: "y_position_mid [m]", PSI: "psi_hat [rad]", U: "u_velo [m/s]", V: "vm_velo [m/s]",
    R: "r_angvelo [rad/s]",
}  # fmt: skip
_RPS, _RUDDER = "n_prop [rps]", "delta_rudder [rad]"
_WIND_SPEED, _WIND_FROM = "wind_velo_true [m/s]", "wind_dir_true [rad]"
_SAMPLE = 0.1
_CUT_COPIES = ("turn_cut_14-Sep-2020_15_58_08",)
"""Files that are the beginning of another file here: left out, so that no sample stands in training and test at
once."""

_PUBLISHED_TEST = (
    "berthing_12-Nov-2020_11_38_50", "berthing_12-Nov-2020_11_49_21", "berthing_12-Nov-2020_13_21_03",
    "random_06-Aug-2020_16_24_25_3",
    "turn_14-Oct-2020_15_06_53", "zigzag_31-Jul-2020_13_42_53",
)  # fmt: skip
"""Test files of Wakita et al. (2022), from the table in the source's README."""

PUBLIC = PublicData(
    name="esso_osaka",
    url="https://raw.githubusercontent.com/NAOE-5thLab/FRT-DS-ESSO/e694dfd62932bff755f3bc975b5863d649023bc0/data/",
    licence="CC BY-NC-SA 4.0 (https://creativecommons.org/licenses/by-nc-sa/4.0/)",
    terms="NON-COMMERCIAL use only. Name the authors, and pass on what you change under the same licence. (The "
          "source's README says CC BY-NC 4.0,\n"
    "its LICENSE file CC BY-NC-SA 4.0; the stricter one is taken.)",
    citation=(
        "Wakita et al. (2022), On neural network identification for low-speed ship maneuvering model, J. Mar. Sci. "
        "Technol. 27, 772-785, "
        "doi 10.1007/s00773-021-00867-1",
        "Miyauchi et al. (2022), System parameter exploration of ship maneuvering model for automatic "
        "docking/berthing using CMA-ES, "
        "J. Mar. Sci. Technol. 27, 1065-1083, doi 10.1007/s00773-022-00889-3",
    ),
    registry=Path(__file__).with_name("esso_osaka_files.txt"),
)  # fmt: skip

SHIP = Ship(
    name="esso_osaka_3m", L=3.0, B=0.48925, T=0.20114, mass=244.6, Cb=0.830, xG=0.09357, rho=998.0,
    propeller=Propeller(diameter=0.084, x=-1.551, pitch_ratio=0.7151, kt=(0.3278, -0.3323, -0.156), wake=0.614,
        thrust_deduction=0.22),
    rudder=Rudder(area=0.01063, height=float(np.sqrt(0.01063 * 1.539)), x=-1.5),
    wind=Wind(frontal_area=0.13544, lateral_area=0.52038),
)  # fmt: skip
"""Particulars and open-water propeller data of the source; it does not give Izz."""


def find_copy(path: str | None = None) -> Path:
    """Folder of the files: `path`, else the environment variable SHIPBENCH_ESSO_OSAKA, else what `shipbench data get`
    fetched, else ../shared/data/esso-osaka-frt.

    Raises:
        InputError: there is none.
    """
    shared = Path("..", "shared", "data", "esso-osaka-frt")
    named = path or os.environ.get("SHIPBENCH_ESSO_OSAKA")
    candidates = (
        [Path(named)] if named else [public_folder(PUBLIC.name), shared, Path(__file__).resolve().parents[2] / shared]
    )
    for folder in candidates:
        if (folder / "runs.csv").is_file() or not PUBLIC.missing(folder):
            return folder
    part = len(PUBLIC.checksums) - len(PUBLIC.missing(candidates[0]))
    raise InputError(
        f"no Esso Osaka data in {', '.join(map(str, candidates))}" + (f" (only {part} of {len(PUBLIC.checksums)} "
                                                                      "files)" if part else "")
        + ". The data are public, for non-commercial use: github.com/NAOE-5thLab/FRT-DS-ESSO. Download them: "
          "shipbench data get esso_osaka. "
        "Without a network, take a copy: shipbench data get esso_osaka --from FOLDER, or name it: --dataset "
        "'esso_osaka[path=FOLDER]' or "
        "SHIPBENCH_ESSO_OSAKA=FOLDER."
    )  # fmt: skip


def _index(folder: Path) -> pd.DataFrame:
    """Files, manoeuvres and published split of a copy: from its runs.csv, or from the published names."""
    import pandas as pd  # not above: `data list` imports this module

    if not (folder / "runs.csv").is_file():
        names = list(PUBLIC.checksums)
        stems = [Path(name).stem for name in names]
        kinds, splits = (
            [stem.split("_")[0] for stem in stems],
            ["test" if stem in _PUBLISHED_TEST else "" for stem in stems],
        )
        return pd.DataFrame({"file": [find(folder, name) for name in names], "kind": kinds, "wakita2022": splits})
    try:
        with open_regular(folder / "runs.csv") as file:
            index = pd.read_csv(file)[["file", "kind", "wakita2022"]]
        if outside := [
            name for name in map(str, index["file"]) if Path(name).is_absolute() or ".." in Path(name).parts
        ]:
            raise ValueError(f"it names '{outside[0]}', outside the folder")
    except (OSError, ValueError, KeyError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(
            f"{folder / 'runs.csv'} cannot be read: {reason}. It needs the columns file, kind, wakita2022."
        ) from None
    return index.assign(file=[folder / str(file) for file in index["file"]])


def _check_content(folder: Path) -> tuple[str, ...]:
    """Notes on files that are not the published ones: reported for a user's own copy, refused in a download."""
    changed = PUBLIC.changed(folder)
    if not changed:
        return ()
    said = (
        f"{len(changed)} of {len(PUBLIC.checksums)} files differ from the published ones by checksum, the first "
        f"is {changed[0]}"
    )
    if folder == public_folder(PUBLIC.name):
        raise InputError(f"{folder}: {said}. Fetch them again: shipbench data get esso_osaka.")
    return (said,)


def make(path: str | None = None, dt: float = 0.5, wind: bool = True) -> Dataset:
    """Read and convert all runs.

    Args:
        path: folder of the copy.
        dt: sample time [s], a multiple of the files' 0.1 s. States are the samples at t_k; commands and wind are means
            over [t_k, t_k+1), which keeps their impulse.
        wind: give the measured true wind as inputs, or withhold it.

    Raises:
        InputError: no copy, an unknown layout, a dt that is no multiple of 0.1 s, or a `wind` that is neither true nor
            false.
    """
    if not isinstance(wind, bool):  # the text "False" would count as yes
        raise InputError(f"esso_osaka: wind = {wind!r}; accepted: true or false, as in 'esso_osaka[wind=false]'.")
    number = isinstance(dt, (int, float)) and not isinstance(dt, bool) and math.isfinite(dt)
    every = round(dt / _SAMPLE) if number else 0
    if every < 1 or abs(every * _SAMPLE - dt) > 1e-9:
        raise InputError(
            f"esso_osaka: dt = {dt!r} s; the files are sampled at 0.1 s, so dt must be a positive multiple of 0.1, "
            "as 'esso_osaka[dt=0.5]'."
        )
    folder = find_copy(None if path is None else str(path))
    index, remarks = _index(folder), _check_content(folder)
    runs = []
    for file, kind, split in zip(index["file"], index["kind"], index["wakita2022"], strict=True):
        stem = Path(file).name.removesuffix(".gz").removesuffix(".csv")
        if stem in _CUT_COPIES:
            continue
        runs.append(_read_run(Path(file), stem, every, wind, str(kind), "test" in str(split)))
    return Dataset(
        name="esso_osaka" if wind else "esso_osaka_no_wind", ship=SHIP, dt=every * _SAMPLE, runs=tuple(runs),
        actuators="commanded",
        source="github.com/NAOE-5thLab/FRT-DS-ESSO, Osaka University (Wakita et al. 2022; Miyauchi et al. 2022)",
        licence="CC BY-NC-SA 4.0",
        notes=(
            "n and delta are commands, not measured positions; the thrusters are not recorded: taken as zero",
            "the published u and v lag the position by about 0.6 s (the source's own filter); they are used as "
            "published",
            *remarks,
        ),
    )  # fmt: skip


def _read_run(file: Path, stem: str, every: int, wind: bool, kind: str, test: bool) -> Run:
    import pandas as pd

    try:
        with open_regular(file) as opened:
            table = pd.read_csv(opened, compression="gzip" if file.suffix == ".gz" else None)
        raw = table[["t [s]", *_COLUMNS.values(), _RPS, _RUDDER, _WIND_SPEED, _WIND_FROM]].to_numpy(float)
    except (OSError, ValueError, KeyError, EOFError, zlib.error) as error:
        raise InputError(
            f"{file} cannot be read: {' '.join(str(error).split())[:160]}. Take a fresh copy of the public data."
        ) from None
    finite = np.atleast_1d(np.isfinite(raw).all(axis=1))
    whole = int(finite.cumprod().sum())
    if whole < 2 or finite[whole:].any():
        missing = f"{int((~finite).sum())} of {len(raw)} rows lack values, the first is row {whole + 2}"
        raise InputError(
            f"{file}: {missing}; only the end of a file may be empty. Take a fresh copy of the public data."
        )
    raw = raw[:whole]  # one file ends in rows of NaN
    steps = np.diff(raw[:, 0])
    if np.abs(steps - _SAMPLE).max() > 0.01 * _SAMPLE:
        k = int(np.abs(steps - _SAMPLE).argmax())
        raise InputError(
            f"{file}: t goes from {raw[k, 0]:g} s to {raw[k + 1, 0]:g} s; the public files step by 0.1 s. Take a "
            "fresh copy."
        )
    samples = (len(raw) - 1) // every + 1
    at = np.arange(samples) * every
    starts = np.minimum(at, len(raw) - 1)

    def held(values: np.ndarray) -> np.ndarray:
        """Mean over [t_k, t_k+1) of each column; the last interval may be short."""
        sums = np.add.reduceat(values, starts, axis=0)
        return sums / np.diff([*starts, len(raw)])[:, None]

    inputs = np.zeros((samples, len(COMMANDS)))
    inputs[:, :2] = held(raw[:, 7:9] * [60.0, 1.0])
    states = np.zeros((samples, 10))
    raw[:, 1 + list(_COLUMNS).index(PSI)] = np.unwrap(raw[:, 1 + list(_COLUMNS).index(PSI)])
    states[:, list(_COLUMNS)] = raw[at, 1:7]
    # The actuator "state" at t_k is the command that was in force just before, so that S[:, k] repeats U[:, k].
    states[1:, [N, DELTA]] = inputs[:-1, :2]
    states[0, [N, DELTA]] = inputs[0, :2]
    names: tuple[str, ...] = COMMANDS
    if wind:
        vector = held(raw[:, [9]] * np.column_stack([np.cos(raw[:, 10]), np.sin(raw[:, 10])]))
        inputs = np.column_stack([inputs, np.hypot(*vector.T), np.unwrap(np.arctan2(vector[:, 1], vector[:, 0]))])
        names = (*COMMANDS, "wind_speed", "wind_from")
    t = raw[0, 0] + np.arange(samples) * every * _SAMPLE
    # Files of one log carry its time stamp and a number: they stay in one fold.
    head, _, last = stem.rpartition("_")
    group = head if kind == "random" and len(last) == 1 else stem.replace("_cut", "")
    try:
        began = datetime.strptime(group[-20:], "%d-%b-%Y_%H_%M_%S").isoformat()
    except ValueError:
        raise InputError(
            f"{file}: its name holds no time such as 05-Aug-2021_10_20_30; accepted: the names of the public files."
        ) from None
    return Run(
        stem,
        t,
        states,
        inputs,
        names,
        RunMeta(manoeuvre=kind, group=group, split="test" if test else "train", from_=began),
    )


SUMMARY = "measured free-running tests of a 3 m tanker model in wind (downloaded, or your own copy)"
DATASET = DatasetPart("esso_osaka", SUMMARY, "CC BY-NC-SA 4.0", make, cached=False, public=PUBLIC)
