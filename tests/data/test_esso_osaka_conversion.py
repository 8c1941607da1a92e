"""Conversion of the Esso Osaka files, on a small copy made from formulas (the real data are not distributed here)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipbench.data.base import load_dataset
from shipbench.data.esso_osaka import make
from shipbench.errors import InputError

FILES = {
    "turning/turn_14-Sep-2020_15_58_08": "TZB",
    "turning/turn_cut_14-Sep-2020_15_58_08": "TZRB",
    "random/random_06-Aug-2020_16_24_25_1": "TZRB+",
    "random/random_06-Aug-2020_16_24_25_3": "test",
    "random/random_31-Jul-2020_12_29_58": "",
}


def recorded(rows: int = 63, start: float = 0.0) -> pd.DataFrame:
    """A steady turn to starboard at 10 Hz: the heading wraps, the commands jump inside an interval, the wind is
    southerly (from pi)."""
    k = np.arange(rows)
    t, psi = start + 0.1 * k, 2.9 + 0.05 * k * 0.1 * 20
    return pd.DataFrame(
        {
            "t [s]": np.round(t, 1), "x_position_mid [m]": np.sin(psi), "u_velo [m/s]": 0.3 + 0 * t,
            "y_position_mid [m]": -np.cos(psi),
            "vm_velo [m/s]": 0.01 * k, "psi_hat [rad]": (psi + np.pi) % (2 * np.pi) - np.pi,
            "r_angvelo [rad/s]": 1.0 + 0 * t,
            "n_prop [rps]": np.where(k < 7, 10.0, -20.0), "delta_rudder [rad]": np.where(k < 12, 0.1, 0.6),
            "wind_velo_relative_mid [m/s]": 0 * t, "wind_dir_relative_mid [rad]": 0 * t,
            "wind_velo_true [m/s]": 2.0 + 0 * t, "wind_dir_true [rad]": np.where(k % 2, np.pi - 0.2, np.pi + 0.2),
        }
    )  # fmt: skip


def blank(first: int, last: int) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Rows [first, last) lose their values."""
    return lambda table: pd.DataFrame(
        {name: column.mask((table.index >= first) & (table.index < last)) for name, column in table.items()}
    )


@pytest.fixture
def copy(tmp_path) -> Callable[..., Path]:
    """Writes the copy; `change` alters the table of the first file."""

    def write(change: Callable[[pd.DataFrame], pd.DataFrame] = lambda t: t) -> Path:
        for place, name in enumerate(FILES):
            file = tmp_path / f"{name}.csv.gz"
            file.parent.mkdir(exist_ok=True)
            (change(recorded()) if place == 0 else recorded(start=1176.1 * (place == 3))).to_csv(file, index=False)
        kinds = [name.split("/")[0] for name in FILES]
        index = pd.DataFrame(
            {"file": [f"{n}.csv.gz" for n in FILES], "kind": kinds, "wakita2022": list(FILES.values())}
        )
        index.to_csv(tmp_path / "runs.csv", index=False)
        return tmp_path

    return write


def test_states_are_the_samples_at_the_instants_without_smoothing(copy):
    run, raw = make(str(copy())).runs[0], recorded()
    np.testing.assert_array_equal(run.states[:, [0, 1, 3, 4, 5]], raw.iloc[::5, [1, 3, 2, 4, 6]].to_numpy())
    np.testing.assert_allclose(run.states[:, 2], 2.9 + 0.5 * np.arange(13))
    np.testing.assert_allclose(np.diff(run.t), 0.5)


def test_commands_keep_their_impulse_in_our_units(copy):
    run, raw = make(str(copy())).runs[0], recorded()
    np.testing.assert_allclose(run.inputs[:3, 0], [600.0, (2 * 600 - 3 * 1200) / 5, -1200.0])
    for column, ours, factor in (("n_prop [rps]", 0, 60.0), ("delta_rudder [rad]", 1, 1.0)):
        assert run.inputs[:12, ours].sum() * 0.5 == pytest.approx(raw[column][:60].sum() * factor * 0.1)


def test_the_actuator_state_is_the_command_in_force_just_before(copy):
    run = make(str(copy())).runs[0]
    np.testing.assert_array_equal(run.states[1:, 6:8], run.inputs[:-1, :2])
    np.testing.assert_array_equal(run.states[0, 6:8], run.inputs[0, :2])


def test_wind_is_the_mean_vector_and_comes_from_the_side_that_the_file_says(copy):
    run = make(str(copy())).runs[0]
    north, east = run.inputs[:12, 4] * np.cos(run.inputs[:12, 5]), run.inputs[:12, 4] * np.sin(run.inputs[:12, 5])
    np.testing.assert_allclose(north, -2.0 * np.cos(0.2))
    np.testing.assert_allclose(np.abs(east), 2.0 * np.sin(0.2) / 5)
    assert np.abs(np.diff(run.inputs[:12, 5])).max() < 0.2, "no jump of the mean direction across +-pi"


def test_the_copy_of_another_run_is_left_out_and_pieces_of_one_log_share_a_group(copy):
    meta = {r.id: r.meta for r in make(str(copy())).runs}
    assert "turn_cut_14-Sep-2020_15_58_08" not in meta
    assert meta["random_06-Aug-2020_16_24_25_1"].group == meta["random_06-Aug-2020_16_24_25_3"].group
    assert meta["random_31-Jul-2020_12_29_58"].group != meta["random_06-Aug-2020_16_24_25_1"].group
    assert [m.split for m in meta.values()] == ["train", "train", "test", "train"]


@pytest.mark.parametrize(("dt", "samples"), [(0.1, 63), (0.3, 21), (0.5, 13), (1.0, 7), (1, 7)])
def test_any_multiple_of_a_tenth_of_a_second_is_accepted(copy, dt, samples):
    data = make(str(copy()), dt=dt)
    assert data.dt == pytest.approx(dt)
    assert {len(r) for r in data.runs} == {samples}


def test_rows_without_values_at_the_end_are_cut_and_inside_are_refused(copy):
    folder = copy(blank(50, 63))
    assert len(make(str(folder)).runs[0]) == 10
    with pytest.raises(InputError, match=r"turn_14.*first is row 32"):
        make(str(copy(blank(30, 40))))
    with pytest.raises(InputError, match="63 of 63 rows"):
        make(str(copy(blank(0, 63))))


def test_wind_can_be_withheld(copy, monkeypatch):
    monkeypatch.setenv("SHIPBENCH_ESSO_OSAKA", str(copy()))
    with_wind, without = load_dataset("esso_osaka"), load_dataset("esso_osaka[wind=false]")
    assert with_wind.inputs[4:] == ("wind_speed", "wind_from")
    assert len(without.inputs) == 4
    np.testing.assert_array_equal(with_wind.runs[0].states, without.runs[0].states)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("esso_osaka[wind=False]", "accepted: true or false"),
        ("esso_osaka[wind=0]", "accepted: true or false"),
        ("esso_osaka[dt=0.25]", "multiple of 0.1"),
        ("esso_osaka[dt=0]", "multiple of 0.1"),
        ("esso_osaka[dt=-0.5]", "multiple of 0.1"),
        ("esso_osaka[dt=NaN]", "multiple of 0.1"),
        ("esso_osaka[dt=half]", "multiple of 0.1"),
        ("esso_osaka[dt=true]", "multiple of 0.1"),
        ("esso_osaka[smooth=3]", "'smooth'"),
    ],
)
def test_an_option_that_cannot_be_meant_is_refused(copy, monkeypatch, spec, message):
    monkeypatch.setenv("SHIPBENCH_ESSO_OSAKA", str(copy()))
    with pytest.raises(InputError, match=message):
        load_dataset(spec)


def test_damaged_copies_are_refused_with_the_files_name(copy):
    with pytest.raises(InputError, match=r"turn_14.*t goes from 2\.9 s to 3\.1 s"):
        make(str(copy(lambda t: t.drop(index=30))))
    with pytest.raises(InputError, match=r"turn_14.*cannot be read"):
        make(str(copy(lambda t: t.drop(columns="n_prop [rps]"))))
    folder = copy()
    (folder / "turning" / "turn_14-Sep-2020_15_58_08.csv.gz").write_bytes(b"not gzip")
    with pytest.raises(InputError, match=r"turn_14.*cannot be read"):
        make(str(folder))
    (folder / "runs.csv").write_text("name\n1\n")
    with pytest.raises(InputError, match=r"runs\.csv cannot be read"):
        make(str(folder))


def test_without_a_copy_the_message_says_where_the_data_are_and_how_to_name_them(monkeypatch, tmp_path):
    monkeypatch.setenv("SHIPBENCH_ESSO_OSAKA", str(tmp_path))
    with pytest.raises(InputError, match=r"FRT-DS-ESSO.*path=FOLDER.*SHIPBENCH_ESSO_OSAKA"):
        load_dataset("esso_osaka")


@pytest.mark.parametrize("named", ["../secret.csv", "/etc/passwd", "a/../../secret.csv", "no_time_in_its_name.csv"])
def test_an_index_names_public_files_in_its_folder(tmp_path, named):
    (tmp_path / "copy").mkdir()
    recorded().to_csv(tmp_path / "copy" / "no_time_in_its_name.csv", index=False)
    (tmp_path / "copy" / "runs.csv").write_text(f"file,kind,wakita2022\n{named},zigzag,train\n")
    with pytest.raises(InputError, match=r"outside the folder|its name holds no time"):
        make(str(tmp_path / "copy"))
