"""Runs that share samples are one finding a cluster; windows that import cut are none."""

from __future__ import annotations

from dataclasses import replace

from shipbench.checking.base import check_dataset
from shipbench.records import Dataset, Run
from shipbench.suites.checks.clean_sets import base_set


def windows(data: Dataset, run: Run, starts: list[int], length: int, **meta: object) -> list[Run]:
    return [
        replace(run, id=f"w{a}", t=run.t[: min(length, len(run) - a)], states=run.states[a : a + length],
            inputs=run.inputs[a : a + length],
                meta={**meta, "from": a, "to": a + length - 1} if meta else {})
        for a in starts
    ]  # fmt: skip


def test_a_cluster_of_overlapping_windows_is_one_finding_with_one_group():
    data = base_set("kcs", 311)
    (finding,) = [
        f for f in check_dataset(data.with_runs([*windows(data, data.runs[0], [0, 20, 40, 60], 50), *data.runs[1:]]))
    ]
    assert finding.kind == "overlapping runs"
    assert finding.runs == ("w0", "w20", "w40", "w60")
    assert finding.line.count('group = "w0"') == 4
    assert finding.text.startswith("4 runs share samples with one another")


def test_two_clusters_are_two_findings():
    data = base_set("kcs", 311)
    copies = [replace(data.runs[i], id=f"copy{i}") for i in (3, 5)]
    assert [f.runs for f in check_dataset(data.with_runs([*data.runs, *copies]))] == [
        ("run03", "copy3"),
        ("run05", "copy5"),
    ]


def test_windows_that_import_cut_are_no_finding():
    data = base_set("kcs", 311)
    assert (
        check_dataset(data.with_runs([*windows(data, data.runs[0], [0, 40, 80], 40, file="a.csv"), *data.runs[1:]]))
        == []
    )
    others = [
        f.kind for f in check_dataset(data.with_runs([*windows(data, data.runs[0], [0, 40, 80], 40), *data.runs[1:]]))
    ]
    assert others == ["pieces of one log"]
