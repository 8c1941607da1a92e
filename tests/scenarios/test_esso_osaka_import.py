"""The public files of the Esso Osaka through the import, against the loader that was written for them (needs a copy of
the data)."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data.base import load_dataset
from shipbench.data.esso_osaka import SHIP, find_copy
from shipbench.errors import InputError

COLUMNS = {
    "x": ("x_position_mid [m]", "m"), "y": ("y_position_mid [m]", "m"), "psi": ("psi_hat [rad]", "rad"),
    "u": ("u_velo [m/s]", "m/s"),
    "v": ("vm_velo [m/s]", "m/s"), "r": ("r_angvelo [rad/s]", "rad/s"), "n_c": ("n_prop [rps]", "rev/s"),
    "delta_c": ("delta_rudder [rad]", "rad"),
    "wind_speed": ("wind_velo_true [m/s]", "m/s"), "wind_from": ("wind_dir_true [rad]", "rad"),
}  # fmt: skip


@pytest.fixture
def imported(tmp_path):
    """Imports files of the user's copy; `without` leaves channels out of the mapping."""
    try:
        copy = find_copy()
    except InputError:
        pytest.skip("no copy of the Esso Osaka data here (SHIPBENCH_ESSO_OSAKA)")

    def run(pattern, top="", without=()):
        lines = [
            f'{ours} = {{ column = "{name}", unit = "{unit}" }}\n'
            for ours, (name, unit) in COLUMNS.items()
            if ours not in without
        ]
        (tmp_path / "map.toml").write_text(
            f'name = "e"\ndt = 0.5\n{top}\n[time]\ncolumn = "t [s]"\n[channels]\n{"".join(lines)}'
        )
        (tmp_path / "ship.toml").write_text(SHIP.to_toml())
        files = [str(f) for f in sorted(copy.glob(pattern)) if "turn_cut_14-Sep-2020_15" not in f.name]
        out = str(tmp_path / "out")
        result = CliRunner().invoke(
            app,
            [
                "data",
                "import",
                *files,
                "-m",
                str(tmp_path / "map.toml"),
                "--ship",
                str(tmp_path / "ship.toml"),
                "-o",
                out,
            ],
        )
        assert result.exit_code == 0, result.output
        theirs = {r.id: r for r in load_dataset("esso_osaka").runs}
        return [(r, theirs[r.id]) for r in load_dataset(out).runs]

    return run


@pytest.mark.long
def test_all_files_give_the_loaders_samples(imported):
    pairs = imported("*/*.csv.gz", top="antialias = false")
    assert len(pairs) == 33
    for ours, theirs in pairs:
        np.testing.assert_allclose(ours.t, theirs.t, atol=1e-9)
        np.testing.assert_allclose(ours.states, theirs.states, atol=1e-8)
        np.testing.assert_allclose(ours.inputs, theirs.inputs, atol=1e-8)


@pytest.mark.long
def test_speeds_from_the_measured_track_agree_with_the_published_ones(imported):
    for ours, theirs in imported("turning/turn_14-Oct-2020_14_[01]*.csv.gz", without=("u", "v", "r")):
        # The published u and v lag the position by 0.6 s (the data's README).
        later = np.column_stack([np.interp(ours.t - 0.6, ours.t, ours.states[:, j]) for j in (3, 4)])
        assert np.sqrt(np.mean((later - theirs.states[:, 3:5]) ** 2, axis=0)).max() < 0.02  # of 0.3 m/s
        assert np.sqrt(np.mean((ours.states[:, 5] - theirs.states[:, 5]) ** 2)) < np.deg2rad(0.4)  # of 2.7 deg/s
        raw = np.gradient(ours.states[:, :2], ours.t, axis=0)
        psi = ours.states[:, 2]
        surge = raw[:, 0] * np.cos(psi) + raw[:, 1] * np.sin(psi)
        assert np.std(ours.states[:, 3] - theirs.states[:, 3]) < np.std(surge - theirs.states[:, 3])
