"""Named data sets: the cache, harbour90 and its statistics, and the Esso Osaka loader."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from shipbench.data import base
from shipbench.data.base import DATASETS, load_dataset
from shipbench.data.describe import compare_with_paper, statistics, table_ii
from shipbench.data.esso_osaka import find_copy
from shipbench.errors import InputError


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def _cached(monkeypatch, cache):
    monkeypatch.setenv("SHIPBENCH_CACHE", str(cache))


@pytest.fixture(scope="module")
def harbour90(cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHIPBENCH_CACHE", str(cache))
        return load_dataset("harbour90")


def test_every_data_set_has_a_name_a_summary_and_a_licence():
    for name in DATASETS.names():
        part = DATASETS.get(name)
        assert part.name == name
        assert part.summary
        assert part.licence


def test_harbour90_has_90_runs_of_120_seconds(harbour90):
    assert len(harbour90) == 90
    assert {len(r) for r in harbour90.runs} == {121}
    assert harbour90.dt == 1.0


def test_harbour90_meets_table_ii(harbour90):
    assert compare_with_paper(harbour90)["difference / paper std"].abs().max() <= 0.25
    ours = statistics(harbour90)
    assert ours.at["u", "min"] < 0.0
    assert max(abs(ours.at["r", "min"]), ours.at["r", "max"]) == pytest.approx(0.02, abs=0.002)
    for thruster in ("F_b", "F_s"):
        assert ours.at[thruster, "P10"] == ours.at[thruster, "P90"] == 0.0
    assert max(abs(ours.at["F_b", "min"]), ours.at["F_b", "max"]) == pytest.approx(63e3, rel=0.01)


def test_table_ii_is_the_papers():
    assert table_ii().at["n_c", "P90"] == 166.7
    assert table_ii().at["delta", "unit"] == "deg"


def test_statistics_are_of_all_samples(harbour):
    stacked = np.concatenate([r.states for r in harbour.runs])
    assert statistics(harbour).at["u", "mean"] == pytest.approx(stacked[:, 3].mean())
    assert statistics(harbour).at["delta", "max"] == pytest.approx(np.rad2deg(stacked[:, 7].max()))


def test_the_cached_copy_is_the_same_as_a_fresh_one(harbour90):
    again, fresh = load_dataset("harbour90"), load_dataset("harbour90", remake=True)
    assert again.fingerprint == fresh.fingerprint == harbour90.fingerprint


def test_another_seed_is_another_data_set(harbour90):
    assert load_dataset("harbour90[seed=20]").fingerprint != harbour90.fingerprint


@pytest.mark.long
def test_a_damaged_cache_is_made_anew_and_said_so(harbour90, cache, caplog):
    (cache / "harbour90-v1" / "fingerprint.txt").write_text("0")
    with caplog.at_level(logging.WARNING):
        assert load_dataset("harbour90").fingerprint == harbour90.fingerprint
    assert "damaged" in caplog.text
    (cache / "harbour90-v1" / "trajectories.parquet").write_bytes(b"PAR1")
    with caplog.at_level(logging.WARNING):
        assert load_dataset("harbour90").fingerprint == harbour90.fingerprint
    assert "cannot be read" in caplog.text


@pytest.mark.long
def test_a_cache_that_cannot_be_written_costs_no_result(monkeypatch, tmp_path, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr(
        base, "_make", lambda part, params: load_dataset.__globals__["DATASETS"].get("harbour90").make()
    )
    with caplog.at_level(logging.WARNING):
        assert len(load_dataset("harbour90")) == 90
    assert "cannot be kept" in caplog.text


@pytest.mark.long
def test_noise_and_gusts_change_what_is_measured(harbour90):
    noisy = load_dataset("harbour90_noisy")
    psi = np.concatenate([np.diff(r.states[:, 2] - np.cumsum(r.states[:, 5])) for r in noisy.runs])
    assert psi.std() == pytest.approx(np.sqrt(2 * np.deg2rad(0.3) ** 2 + np.deg2rad(0.05) ** 2), rel=0.1)
    assert noisy.fingerprint != harbour90.fingerprint


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("harbor90", "Did you mean 'harbour90'"),
        ("harbour90[sead=3]", "sead"),
        ("esso_osaka[path=/nowhere]", "FRT-DS-ESSO"),
        ("no/such/folder", "folder"),
    ],
)
def test_bad_names_are_named(spec, expected):
    with pytest.raises(InputError, match=expected):
        load_dataset(spec)


def test_a_folder_without_a_description_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"dataset\.toml"):
        load_dataset(str(tmp_path))


# -- real measured runs
# ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def esso():
    try:
        find_copy()
    except InputError:
        pytest.skip("the Esso Osaka data (CC BY-NC-SA, not distributed here) are not at hand")
    return load_dataset("esso_osaka")


def test_esso_osaka_is_read_in_our_units_and_signs(esso):
    assert len(esso) == 33
    assert sum(r.meta.split == "test" for r in esso.runs) == 6
    stacked = np.concatenate([r.states for r in esso.runs])
    assert np.abs(stacked[:, 6]).max() == pytest.approx(1200.0)
    turns = [r for r in esso.runs if r.meta.manoeuvre == "turn"]
    assert len(turns) == 12
    for run in turns:
        end = run.states[len(run) // 2 : -40]
        assert np.sign(np.median(end[:, 5])) == np.sign(np.median(end[:, 7])), "positive rudder turns to starboard"


def test_esso_osaka_velocities_agree_with_its_positions(esso):
    for run in esso.runs:
        psi, u, v = run.states[:, 2], run.states[:, 3], run.states[:, 4]
        rate = np.stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)], axis=1)
        travelled = np.sum(0.5 * (rate[1:] + rate[:-1]), axis=0) * esso.dt
        length = np.sum(np.hypot(*np.diff(run.states[:, :2], axis=0).T))
        assert np.linalg.norm(run.states[-1, :2] - run.states[0, :2] - travelled) < 0.02 * length + 0.2


def test_pieces_of_one_log_share_a_group_and_the_cut_copy_is_left_out(esso):
    pieces = [r for r in esso.runs if r.id.startswith("random_06-Aug-2020_16_24_25")]
    assert len(pieces) == 5
    assert {r.meta.group for r in pieces} == {"random_06-Aug-2020_16_24_25"}
    assert "turn_cut_14-Sep-2020_15_58_08" not in [r.id for r in esso.runs]


def test_commanded_actuators_repeat_the_command_before(esso):
    for run in esso.runs:
        np.testing.assert_array_equal(run.states[1:, 6:8], run.inputs[:-1, :2])


def test_the_hold_figure_of_the_datas_readme_is_met(esso):
    from shipbench.predictors.hold import Hold

    test = esso.with_runs(r for r in esso.runs if r.meta.split == "test").windows(200)
    batch = test.batch()
    assert len(batch.ids) == 15
    S = Hold().fit(test).predict(batch.s0, batch.U)
    rmse = np.sqrt(np.mean(np.sum((S[..., :2] - batch.truth[..., :2]) ** 2, axis=-1), axis=1)).mean()
    assert rmse == pytest.approx(6.29, rel=0.02)
