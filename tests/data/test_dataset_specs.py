"""Specs and cache of named data sets: nothing that a user writes is ignored silently, and a spoilt cache never reaches
a result."""

from __future__ import annotations

import logging
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from toy_ship import TOY_SHIP, sail

from shipbench.data import base, files
from shipbench.data.base import DatasetPart, load_dataset
from shipbench.data.describe import compare_with_paper
from shipbench.errors import InputError, WorkError
from shipbench.records import Dataset, Run


def make(seed: int = 0, scale: float = 1.0) -> Dataset:
    S, C = sail(8, int(seed))
    return Dataset("made", TOY_SHIP, 1.0, (Run("a", np.arange(9.0), S * scale, C),))


@pytest.fixture
def made(monkeypatch, tmp_path):
    """A cached data set "made" beside the shipped ones; the value is the list of its makings."""
    calls: list[dict] = []

    def counted(seed: int = 0, scale: float = 1.0) -> Dataset:
        calls.append({"seed": seed, "scale": scale})
        return make(seed, scale)

    class Shelf:
        def names(self) -> list[str]:
            return ["made"]

        def __contains__(self, name: str) -> bool:
            return name in self.names()

        def get(self, name: str) -> DatasetPart:
            return DatasetPart(name, "a toy", "MIT", counted, cached=True)

        def digest(self, name: str) -> str:
            return ""

    monkeypatch.setattr(base, "DATASETS", Shelf())
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    return calls


def test_the_second_load_is_from_the_cache_and_the_same(made):
    assert load_dataset("made").fingerprint == load_dataset("made").fingerprint == make().fingerprint
    assert len(made) == 1


def test_every_set_of_parameters_has_its_own_place_in_the_cache(made):
    specs = ["made", "made[seed=1]", "made[seed=-1]", "made[scale=1.5]", "made[scale=15]", "made[seed=1,scale=1.5]"]
    first = [load_dataset(spec.replace("-1", "2")).fingerprint for spec in specs]
    assert len(made) == len(specs)
    assert [load_dataset(spec.replace("-1", "2")).fingerprint for spec in specs] == first
    assert len(made) == len(specs)


def test_options_count_as_parameters(made):
    assert load_dataset("made", seed=3).fingerprint == load_dataset("made[seed=3]").fingerprint
    assert made == [{"seed": 3, "scale": 1.0}]


@pytest.mark.parametrize("file", ["fingerprint.txt", "trajectories.parquet", "dataset.toml", "ship.toml"])
@pytest.mark.parametrize("content", [None, b"", bytes(range(128, 256))])
def test_a_spoilt_cache_is_made_anew_and_said_so(made, tmp_path, caplog, file, content):
    load_dataset("made")
    spoilt = tmp_path / "cache" / "made-v1" / file
    spoilt.unlink()
    if content is not None:
        spoilt.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        assert load_dataset("made").fingerprint == make().fingerprint
    assert len(made) == 2
    assert "made anew" in caplog.text


def open_to_others(folder: Path) -> None:
    folder.chmod(0o777)


def a_file(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("")


def a_link(folder: Path) -> None:
    folder.rename(folder.with_name("moved"))
    (folder.parent / "moved" / "fingerprint.txt").write_text("0")
    folder.symlink_to("moved")


def a_pipe(folder: Path) -> None:
    (folder / "fingerprint.txt").unlink()
    os.mkfifo(folder / "fingerprint.txt")


def of_another(folder: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give files away")
    os.chown(folder, 65534, 65534)


@pytest.mark.parametrize("spoil", [open_to_others, a_file, a_link, a_pipe, of_another])
def test_a_cache_that_others_could_have_made_is_made_anew_once(made, tmp_path, caplog, spoil):
    load_dataset("made")
    folder = tmp_path / "cache" / "made-v1"
    assert [p.stat().st_mode & 0o777 for p in (folder.parent, folder)] == [0o700, 0o700]
    spoil(folder)
    with caplog.at_level(logging.WARNING):
        assert load_dataset("made").fingerprint == load_dataset("made").fingerprint == make().fingerprint
    assert len(made) == 2
    assert caplog.text.count("made anew") == 1


def test_what_a_killed_process_left_is_removed_when_it_is_old(made, tmp_path):
    old, young = tmp_path / "cache" / ".making-old", tmp_path / "cache" / ".making-young"
    old.mkdir(parents=True)
    young.mkdir()
    os.utime(old, (0, 0))
    load_dataset("made")
    assert (old.exists(), young.exists()) == (False, True)


def test_a_cache_that_fails_in_the_middle_costs_no_result_and_leaves_nothing(made, monkeypatch, tmp_path, caplog):
    def full(*args, **options):
        raise InputError("no space left")

    monkeypatch.setattr(files, "write_dataset", full)
    with caplog.at_level(logging.WARNING):
        assert load_dataset("made").fingerprint == make().fingerprint
    assert "cannot be kept" in caplog.text
    assert list((tmp_path / "cache").iterdir()) == []


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("made[sede=1]", "'sede'. Did you mean 'seed'"),
        ("made[seed=abc]", "seed=abc"),
        ("made+current", "effects"),
        ("file.py:made", "effects|unknown folder or data set"),
        ("made[seed]", "has no value"),
        ("mad", "Did you mean 'made'"),
    ],
)
def test_what_a_spec_says_wrongly_is_refused(made, spec, message):
    with pytest.raises(InputError, match=message):
        load_dataset(spec)
    assert not any(call["seed"] == 0 for call in made)


def test_a_fault_of_the_maker_is_not_blamed_on_the_user(made, monkeypatch):
    def broken(seed: int = 0) -> Dataset:
        raise WorkError("the simulator diverged") if seed else TypeError("a bug")

    monkeypatch.setattr(
        base.DATASETS, "get", lambda name: DatasetPart(name, "", "MIT", broken, cached=False), raising=False
    )
    with pytest.raises(TypeError, match="a bug"):
        load_dataset("made")
    with pytest.raises(WorkError, match="diverged"):
        load_dataset("made[seed=1]")


def test_a_folder_takes_no_parameters(tmp_path):
    files.write_dataset(make(), tmp_path)
    with pytest.raises(InputError, match="seed"):
        load_dataset(str(tmp_path), seed=3)
    assert load_dataset(str(tmp_path)).fingerprint == make().fingerprint


def test_a_mat_file_that_is_no_file_is_named_as_what_it_is(tmp_path):
    os.mkfifo(tmp_path / "a.mat")
    (tmp_path / "b.mat").symlink_to("nowhere")
    for name, message in (("a.mat", "a named pipe"), ("b.mat", "does not exist")):
        with pytest.raises(InputError, match=message):
            load_dataset(str(tmp_path / name))


def test_the_plain_difference_makes_no_allowance_for_rounding():
    still = Dataset("still", TOY_SHIP, 1.0, (Run("a", np.arange(9.0), np.zeros((9, 10)), np.zeros((9, 4))),))
    table = compare_with_paper(still).set_index(["signal", "statistic"])
    assert table.at[("r", "std"), "plain difference / paper std"] == pytest.approx(-1.0)
    assert table.at[("r", "std"), "difference / paper std"] == pytest.approx(-0.5)
    assert (
        table.at[("u", "mean"), "plain difference / paper std"]
        == table.at[("u", "mean"), "difference / paper std"]
        == pytest.approx(-3.82 / 0.74)
    )
