"""Metadata of runs: what is accepted, what the messages say, and that files stay as they were."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError, replace
from datetime import date, datetime

import numpy as np
import pytest
import tomli_w
from toy_ship import TOY_SHIP, sail

import shipbench as sb
from shipbench import InputError, Run, RunMeta
from shipbench.data.files import read_dataset, write_dataset
from shipbench.data.mat import read_mat, write_mat
from shipbench.records import Dataset
from shipbench.run_meta import Origin

FULL = {
    "load": "ballast", "file": "logs/a.csv", "from": "2026-05-04T10:30:00Z", "to": "2026-05-04T10:31:00Z",
    "origin": {"lat": 53.5, "lon": 8}, "group": 7, "manoeuvre": "zigzag 20/20", "split": "train",
    "crew": {"watch": "B", "ranks": [1, 2]}, "parent": "long run",
}  # fmt: skip


def run(meta: object = None, name: str = "r0") -> Run:
    S, C = sail(20, 0)
    return Run(name, np.arange(21.0), S, C, meta={} if meta is None else meta)


def test_a_dict_becomes_a_record_with_the_settled_fields_and_what_a_user_added():
    meta = run(FULL).meta
    assert (meta.manoeuvre, meta.group, meta.parent, meta.split) == ("zigzag 20/20", 7, "long run", "train")
    assert (meta.file, meta.from_, meta.to) == ("logs/a.csv", FULL["from"], FULL["to"])
    assert meta.origin == Origin(lat=53.5, lon=8)
    assert meta.other == {"load": "ballast", "crew": {"watch": "B", "ranks": [1, 2]}}
    assert run(meta).meta is meta
    assert pickle.loads(pickle.dumps(meta)).as_dict() == FULL
    with pytest.raises(FrozenInstanceError):
        meta.split = "test"


def test_what_is_not_stated_is_none():
    bare = run()
    assert bare.meta == RunMeta()
    assert bare.meta.as_dict() == {}
    assert (bare.group, bare.kind, bare.parent, bare.began) == ("r0", "", "r0", None)
    assert run({"group": None, "split": None}).meta == RunMeta()


def test_a_flat_table_keeps_the_order_of_its_keys():
    assert list(run(FULL).meta.as_dict()) == list(FULL)
    assert list(replace(run({"load": 1, "split": "test"}).meta, group="a").as_dict()) == ["group", "load", "split"]
    assert list(replace(RunMeta(split="test", manoeuvre="turn"), parent="a").as_dict()) == [
        "parent", "manoeuvre", "split",
    ]  # fmt: skip


def test_the_table_of_a_file_is_written_as_it_was(tmp_path):
    write_dataset(Dataset("toy", TOY_SHIP, 1.0, (run(FULL),)), tmp_path, "csv")
    text = (tmp_path / "dataset.toml").read_text()
    assert tomli_w.dumps({"runs": {"r0": FULL}}) in text
    again = read_dataset(tmp_path)
    write_dataset(again, tmp_path, "csv")
    assert (tmp_path / "dataset.toml").read_text() == text
    write_mat(again, tmp_path / "toy.mat")
    assert read_mat(tmp_path / "toy.mat").runs[0].meta.as_dict() == FULL


def test_a_window_names_its_run_and_a_piece_its_group():
    window = run({"split": "test"}).slice(0, 5)
    assert window.meta == RunMeta(split="test", parent="r0")
    assert window.slice(0, 3).parent == "r0"
    assert RunMeta(split="test").in_group("log").group == "log"
    assert RunMeta(group="mine").in_group("log").group == "mine"


@pytest.mark.parametrize("given", [datetime(2026, 5, 1, 10), date(2026, 5, 1), "2026-05-01", 12.5, 3, np.int64(3)])
def test_a_time_is_an_iso_date_and_time_or_seconds(given):
    meta = RunMeta(from_=given, to=given)
    assert meta.from_ == meta.to == given
    tomli_w.dumps(meta.as_dict())  # no type of numpy is left


@pytest.mark.parametrize(
    ("key", "value", "accepted"),
    [
        ("manoeuvre", 20, "a name in quotation marks"), ("manoeuvre", "a\x1b[2J", "visible characters"),
        ("manoeuvre", "x" * 81, "at most 80"), ("group", True, "a name in quotation marks"),
        ("group", 1.5, "a name in quotation marks"), ("parent", 3, "a name in quotation marks"),
        ("split", "Test", "'train' or 'test'"), ("split", ["test"], "'train' or 'test'"),
        ("from", "soon", "ISO 8601"), ("from", float("nan"), "ISO 8601"), ("to", True, "seconds of the log"),
        ("from", "2026-05-01\x1b10:30", "ISO 8601"), ("file", "a\u202eb.csv", "visible characters"),
        ("origin", {"lat": 95.0, "lon": 8.0}, "lat from -90 to 90"), ("origin", [53.5, 8.6], "lat from -90 to 90"),
        ("origin", {"lat": 53.5}, "lat from -90 to 90"), ("origin", {"lat": "53", "lon": 8.0}, "in degrees"),
    ],
)  # fmt: skip
def test_an_entry_that_is_wrong_is_refused_with_the_run_and_what_is_accepted(key, value, accepted):
    with pytest.raises(InputError, match=f"run 'r0': {key} = .*accepted: .*{accepted}") as caught:
        run({key: value})
    assert str(caught.value).isprintable()


def test_metadata_are_a_table_and_its_keys_are_labels():
    with pytest.raises(InputError, match=r"run 'r0': meta = \['a'\]; accepted: a dict"):
        run(["a"])
    with pytest.raises(InputError, match="run 'r0': key of meta = 3 is no text"):
        run({3: "a"})
    with pytest.raises(InputError, match=r"other holds 'from'.*Give from_="):
        RunMeta(other={"from": 1.0})


def test_a_long_table_takes_dicts_and_records_and_names_the_run_that_is_wrong():
    frame = Dataset("toy", TOY_SHIP, 1.0, (run(name="a"), run(name="b"))).to_frame()
    data = sb.Dataset.from_frame(frame, TOY_SHIP, meta={"a": {"manoeuvre": "turn"}, "b": RunMeta(split="test")})
    assert [r.meta for r in data] == [RunMeta(manoeuvre="turn"), RunMeta(split="test")]
    with pytest.raises(InputError, match="run 'b': split = 'valid'; accepted: 'train' or 'test'"):
        sb.Dataset.from_frame(frame, TOY_SHIP, meta={"b": {"split": "valid"}})


def test_a_wrong_entry_of_a_file_is_named_with_its_place(tmp_path):
    write_dataset(Dataset("toy", TOY_SHIP, 1.0, (run({"split": "test"}),)), tmp_path, "csv")
    path = tmp_path / "dataset.toml"
    path.write_text(path.read_text().replace('"test"', '"exam"'))
    with pytest.raises(InputError, match=r"dataset\.toml: \[runs\.r0\]: split = 'exam'; accepted: 'train' or 'test'"):
        read_dataset(tmp_path)
