"""Outputs of an FMU as states: tracks that are integrated, poses that are moved, actuators that follow."""

from __future__ import annotations

import numpy as np
import pytest
from made_fmu import description, sail_fmu, write_archive

from shipbench.predictors.fmu_model.description import read_description
from shipbench.predictors.fmu_model.mapping import Mapping, mapping_of
from shipbench.predictors.fmu_model.signals_of import input_values, start_values, states_of

ALL = ("x", "y", "psi", "u", "v", "r")


@pytest.fixture(scope="module")
def batch():
    return sail_fmu(3, 40).batch()


@pytest.fixture
def mapping(tmp_path):
    def made(outputs: tuple[str, ...], start: tuple[str, ...]) -> Mapping:
        path = write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": description()})
        lines = ["[inputs]", 'n_c = { variable = "n_c", unit = "rev/s" }', 'delta_c = "delta_c"']
        lines += ["[outputs]", *(f'{s} = "{s}"' for s in outputs), "[start]", *(f'{s} = "{s}"' for s in start)]
        path.with_name("ship.fmu.toml").write_text("\n".join(lines))
        return mapping_of(read_description(path))

    return made


def outputs(states: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    return states[..., [ALL.index(n) for n in names]]


def test_inputs_and_starts_are_in_its_units(mapping, batch):
    found = mapping(ALL, ("u",))
    np.testing.assert_allclose(input_values(found, batch.U, ("n_c", "delta_c"))[..., 0], batch.U[..., 0] / 60.0)
    np.testing.assert_array_equal(start_values(found, batch.s0), batch.s0[:, 3:4])


def test_a_track_without_outputs_is_integrated(mapping, batch):
    whole = np.concatenate([batch.s0[:, None], batch.truth], axis=1)
    S = states_of(mapping(("u", "v", "r"), ()), outputs(whole, ("u", "v", "r")), batch.s0, batch.U, 1.0)
    np.testing.assert_allclose(S[..., :3], batch.truth[..., :3], atol=0.1)
    np.testing.assert_array_equal(S[..., 6], batch.U[..., 0])  # no output: the shaft follows its command


def test_a_pose_that_cannot_be_set_is_moved_to_the_start(mapping, batch):
    """The FMU begins at its origin, heading 0.7 rad, whatever the ship's start is."""
    whole = np.concatenate([batch.s0[:, None], batch.truth], axis=1)
    for run in range(len(whole)):
        x, y, psi = whole[run, 0, :3]
        c, s = np.cos(0.7 - psi), np.sin(0.7 - psi)
        dx, dy = whole[run, :, 0] - x, whole[run, :, 1] - y
        whole[run, :, 0], whole[run, :, 1] = c * dx - s * dy, s * dx + c * dy
        whole[run, :, 2] += 0.7 - psi
    S = states_of(mapping(ALL, ("u", "v", "r")), outputs(whole, ALL), batch.s0, batch.U, 1.0)
    np.testing.assert_allclose(S[..., :6], batch.truth[..., :6], atol=1e-9)


def test_a_wrapped_heading_is_continued_from_the_start(mapping, batch):
    s0, truth = batch.s0.copy(), batch.truth.copy()
    s0[:, 2] += 4 * np.pi
    truth[..., 2] += 4 * np.pi
    whole = np.concatenate([s0[:, None], truth], axis=1)
    whole[..., 2] = np.mod(whole[..., 2], 2 * np.pi)
    S = states_of(mapping(ALL, ALL), outputs(whole, ALL), s0, batch.U, 1.0)
    np.testing.assert_allclose(S[..., 2], truth[..., 2], atol=1e-9)
