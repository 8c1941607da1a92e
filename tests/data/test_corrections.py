"""What dataset.toml says of frames, clocks, biases, bad samples and gaps is applied by the loader, and what it cannot
mean is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipbench.data.files import read_dataset, write_dataset
from shipbench.errors import InputError
from shipbench.records import Dataset
from shipbench.signals import COMMANDS, DELTA, PSI, R, U, V


@pytest.fixture
def load(toy_folder) -> Callable[..., Dataset]:
    """Loads the toy folder with a changed table and lines added to dataset.toml; `load.clean` is the set without
    either."""
    folder: Path = toy_folder(runs=2)
    path = next(folder.glob("trajectories*"))
    table = pd.read_csv(path)
    clean = read_dataset(folder)
    text = (folder / "dataset.toml").read_text()

    def read(lines: str = "", change: Callable[[pd.DataFrame], pd.DataFrame] = lambda t: t) -> Dataset:
        change(table.copy()).to_csv(path, index=False)
        (folder / "dataset.toml").write_text(f"{lines}\n{text}")
        return read_dataset(folder)

    read.clean = clean  # type: ignore[attr-defined]
    return read


def assert_same(a: Dataset, b: Dataset) -> None:
    for one, other in zip(a.runs, b.runs, strict=True):
        np.testing.assert_allclose(one.states, other.states, rtol=1e-9, atol=1e-9)


def east_north(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(x=t["y"], y=t["x"])


def test_frames(load):
    assert_same(load('frame = "east-north"', east_north), load.clean)
    assert_same(load('frame = "ENU"', lambda t: east_north(t).assign(psi=np.pi / 2 - t["psi"])), load.clean)


def test_velocities_in_earth_axes(load):
    def turned(t: pd.DataFrame) -> pd.DataFrame:
        north, east = (
            np.cos(t["psi"]) * t["u"] - np.sin(t["psi"]) * t["v"],
            np.sin(t["psi"]) * t["u"] + np.cos(t["psi"]) * t["v"],
        )
        return t.assign(u=north, v=east)

    assert_same(load('velocities = "earth"', turned), load.clean)
    assert_same(
        load('velocities = "earth-east-north"', lambda t: turned(t).assign(u=turned(t)["v"], v=turned(t)["u"])),
        load.clean,
    )


def test_a_current_of_all_runs_and_of_one(load):
    loaded = load('velocities = "water"\ncurrent = [0.3, -0.2]\nruns.r01.current = [0.0, 0.5]')
    for run, clean, (north, east) in zip(loaded.runs, load.clean.runs, ((0.3, -0.2), (0.0, 0.5)), strict=True):
        added = (run.states[:, U] - clean.states[:, U] + 1j * (run.states[:, V] - clean.states[:, V])) * np.exp(
            1j * clean.states[:, PSI]
        )
        np.testing.assert_allclose(added, north + 1j * east, atol=1e-9)


def test_scale_bias_and_antenna(load):
    def change(t: pd.DataFrame) -> pd.DataFrame:
        x, y = 5.0 * np.cos(t["psi"]) + 2.0 * np.sin(t["psi"]), 5.0 * np.sin(t["psi"]) - 2.0 * np.cos(t["psi"])
        return t.assign(u=1.1 * t["u"] + 0.2, x=t["x"] + x, y=t["y"] + y)

    assert_same(load("scale.u = 1.1\nbias.u = 0.2\nantenna = [5.0, -2.0]", change), load.clean)


def test_the_bias_of_one_run_stands_for_that_of_all(load):
    loaded = load("bias.r = 0.1\nruns.r01.bias.r = 0.3")
    for run, clean, bias in zip(loaded.runs, load.clean.runs, (0.1, 0.3), strict=True):
        np.testing.assert_allclose(run.states[:, R], clean.states[:, R] - bias, atol=1e-12)


def test_a_delay_is_undone_and_costs_its_samples_at_the_end(load):
    loaded = load("delay.r = 2.0", lambda t: t.assign(r=t.groupby("trajectory")["r"].shift(2).bfill()))
    for run, clean in zip(loaded.runs, load.clean.runs, strict=True):
        assert len(run) == len(clean) - 2
        np.testing.assert_allclose(run.states[:, R], clean.states[:-2, R], atol=1e-12)
        np.testing.assert_allclose(run.states[:, PSI], clean.states[:-2, PSI], atol=1e-12)


def test_a_late_command_moves_by_whole_samples(load):
    loaded = load(
        "delay.delta_c = 2.3", lambda t: t.assign(delta_c=t.groupby("trajectory")["delta_c"].shift(2).bfill())
    )
    for run, clean in zip(loaded.runs, load.clean.runs, strict=True):
        np.testing.assert_array_equal(
            run.inputs[:, COMMANDS.index("delta_c")], clean.inputs[: len(run), COMMANDS.index("delta_c")]
        )


def test_fill_bridges_and_cut_splits_into_pieces_of_one_group(load):
    spoilt = load("runs.r00.fill.delta = [[5.0, 6.0]]\nruns.r01.cut = [[10.0, 12.0]]")
    np.testing.assert_allclose(np.diff(spoilt.runs[0].states[4:8, DELTA], n=2), 0.0, atol=1e-12)
    assert [(run.id, len(run), run.meta.group) for run in spoilt.runs] == [
        ("r00", 41, None),
        ("r01#1", 10, "r01"),
        ("r01#2", 28, "r01"),
    ]


def test_gaps_split_and_no_delay_reaches_over_them(load):
    def holes(t: pd.DataFrame) -> pd.DataFrame:
        t = t.drop(index=range(10, 13))
        t.loc[t.index[-5:], ["t", "u", "r"]] = np.nan
        return t

    with pytest.raises(InputError):
        load("", holes)
    loaded = load('gaps = "split"\ndelay.r = 1.0', holes)
    assert [(run.id, len(run)) for run in loaded.runs] == [("r00#1", 9), ("r00#2", 27), ("r01", 35)]
    np.testing.assert_allclose(loaded.runs[1].states[:, R], load.clean.runs[0].states[14:, R], atol=1e-12)


def test_wind_to_becomes_wind_from(load):
    loaded = load('signs.wind_from = "to"', lambda t: t.assign(wind_speed=3.0, wind_from=2.0))
    np.testing.assert_allclose(loaded.runs[0].inputs[:, -1], 2.0 - np.pi)


def test_a_set_written_again_is_not_corrected_twice(load, tmp_path):
    loaded = load("bias.r = 0.1\nruns.r01.bias.r = 0.3\nruns.r01.cut = [[10.0, 12.0]]")
    write_dataset(loaded, tmp_path / "again")
    assert read_dataset(tmp_path / "again").fingerprint == loaded.fingerprint


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("bias.speed = 1.0", "signal in [bias]"), ("scale.u = 0.0", "other than 0"),
        ("scale.u = 1e300", "within 1e-09 to 1e+09"),
        ("bias.x = -1e300", "within 0 to 1e+09"), ("delay.r = inf", "finite"), ('frame = "up"', "frame"),
        ('velocities = "water"', "current"), ("current = [1.0, 0.0]", 'velocities = "body"'),
        ("runs.r00.cut = [1.0, 2.0]", "[runs.r00] cut"),
        ("runs.r00.fill.r = [[-1.0, 1e9]]", "covers the whole run"),
        ("runs.r00.cut = [[-1.0, 1e9]]", "delays leave no two samples"),
        ('gaps = "ignore"', "gaps"), ("antenna = [1.0]", "antenna"), ("antenna = [inf, 0.0]", "finite"),
    ],
)  # fmt: skip
def test_what_it_cannot_mean_is_refused(lines, said, load):
    with pytest.raises(InputError) as error:
        load(lines)
    assert said in str(error.value)
