"""The known quirks of the published Esso Osaka files are found in them as they are, without being told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tomli_w

from shipbench.checking.base import check_path
from shipbench.checking.finding import Finding
from shipbench.data.esso_osaka import SHIP
from shipbench.data.files import read_dataset
from shipbench.suites.checks.suite import apply_lines

SHARED = Path(__file__).parents[3] / "shared" / "data" / "esso-osaka-frt"
FILES = sorted(SHARED.glob("*/*.csv.gz"))
COLUMNS = {
    "t [s]": "t", "x_position_mid [m]": "x", "y_position_mid [m]": "y", "psi_hat [rad]": "psi", "u_velo [m/s]": "u",
    "vm_velo [m/s]": "v",
    "r_angvelo [rad/s]": "r", "n_prop [rps]": "n", "delta_rudder [rad]": "delta", "wind_velo_true [m/s]": "wind_speed",
    "wind_dir_true [rad]": "wind_from",
}  # fmt: skip
pytestmark = pytest.mark.skipif(
    not FILES, reason="the Esso Osaka data are not here (non-commercial licence): shipbench data get esso_osaka"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """All files in one table, with nothing but the names of the columns."""
    path = tmp_path_factory.mktemp("esso")
    table = pd.concat([pd.read_csv(f).assign(trajectory=f.name.removesuffix(".csv.gz")) for f in FILES])
    table.to_parquet(path / "trajectories.parquet", index=False)
    (path / "dataset.toml").write_text(
        tomli_w.dumps({"name": "raw", "dt": 0.1, "actuators": "measured", "columns": COLUMNS})
    )
    (path / "ship.toml").write_text(SHIP.to_toml())
    return path


@pytest.fixture(scope="module")
def found(folder) -> list[Finding]:
    return check_path(str(folder))[1]


def of(found: list[Finding], kind: str) -> Finding:
    matching = [f for f in found if f.kind == kind]
    assert matching, f"no '{kind}' among {[f.kind for f in found]}"
    return matching[0]


def test_revolutions_are_per_second(found):
    assert of(found, "unit").line == '[units]\nn = "rev/s"'


def test_n_and_delta_are_commands(found):
    commands = of(found, "commands")
    assert set(commands.channels) == {"n", "delta"}
    assert commands.line == 'actuators = "commanded"'


def test_one_file_ends_in_rows_without_values(found):
    tail = of(found, "NaN tail")
    assert tail.runs == ("zigzag_31-Jul-2020_13_50_28",)
    assert tail.evidence["rows"] == 327


def test_one_file_is_the_beginning_of_another(found):
    piece = of(found, "piece of a run")
    assert set(piece.runs) == {"turn_14-Sep-2020_15_58_08", "turn_cut_14-Sep-2020_15_58_08"}
    assert "from 0 s to 286.8 s" in piece.text


def test_four_files_are_one_log(found):
    log = of(found, "pieces of one log")
    assert log.runs == tuple(f"random_06-Aug-2020_16_24_25_{i}" for i in (3, 4, 5, 6))
    assert set(of(found, "late start").runs) == set(log.runs)


def test_positions_repeat_the_value_before(found):
    repeated = of(found, "repeated samples")
    assert set(repeated.channels) == {"x", "y"}
    assert 0.005 < repeated.evidence["share"] < 0.08


def test_velocities_lag_the_position(found):
    lag = of(found, "lag")
    assert lag.channels == ("u", "v")
    assert 0.5 < lag.evidence["lag_s"] < 1.1
    assert lag.evidence["left"] < 0.5 * lag.evidence["left_plain"]


def test_the_gyro_of_one_run_drifts(found):
    bias = of(found, "yaw rate bias")
    assert bias.runs == ("random_31-Jul-2020_12_48_39",)
    assert np.rad2deg(abs(bias.evidence["bias_random_31-Jul-2020_12_48_39"])) == pytest.approx(0.03, abs=0.01)


def test_the_heading_is_wrapped_and_the_rudder_coarse(found):
    assert len(of(found, "wrapped heading").runs) == 19
    assert np.rad2deg(of(found, "quantised").evidence["step_rad"]) == pytest.approx(0.57, abs=0.03)


def test_what_is_right_is_not_called_wrong(found):
    """Units and signs of all but n, the frame, the wind, the reference of the heading, and ground for water."""
    assert [f.channels for f in found if f.kind in ("unit", "sign", "sign and unit", "unit and sign")] == [("n",)]
    assert not {f.kind for f in found} & {
        "ENU",
        "heading from east",
        "earth-fixed velocities",
        "through water",
        "wind to",
        "heading bias",
        "scale",
    }


@pytest.mark.long
def test_the_lines_heal(folder, found, tmp_path):
    """What the loader refused it loads, and of the quirks only single outliers of the satellite position are left to a
    second look."""
    again = tmp_path / "healed"
    again.mkdir()
    for name in ("trajectories.parquet", "dataset.toml", "ship.toml"):
        (again / name).write_bytes((folder / name).read_bytes())
    apply_lines(again, found)
    assert read_dataset(again).actuators == "commanded"
    left = {f.kind for f in check_path(str(again))[1] if f.severity != "note"}
    assert left <= {"frozen", "outliers", "jump"}
