"""Data sets on disk where it is easy to read them wrongly without an error: names like NA, units of commands, stale or
damaged tables."""

from __future__ import annotations

import gzip
import itertools
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from toy_ship import TOY_SHIP, sail

from shipbench.data.files import read_dataset, write_dataset
from shipbench.errors import InputError
from shipbench.records import Dataset, Run
from shipbench.run_meta import RunMeta
from shipbench.signals import COMMANDS
from shipbench.units import unit_factor

Edit = Callable[[pd.DataFrame], pd.DataFrame]


def toy(ids: tuple[str, ...] = ("a", "b"), steps: int = 6) -> Dataset:
    made = [sail(steps, i) for i in range(len(ids))]
    runs = tuple(
        Run(i, np.arange(steps + 1.0), S, C, COMMANDS, {"manoeuvre": "weave"})
        for i, (S, C) in zip(ids, made, strict=True)
    )
    return Dataset("toyset", TOY_SHIP, 1.0, runs, source="formula", licence="MIT", simulation="toy", notes=("a note",))


def folder_with(path: Path, edit: Edit | None = None, toml: str = "") -> Path:
    """A data set's folder whose table went through `edit`; `toml` stands in front of the tables of dataset.toml."""
    write_dataset(toy().with_runs([Run(r.id, r.t, r.states, r.inputs) for r in toy().runs]), path, "csv")
    table = path / "trajectories.csv"
    if edit is not None:
        edit(pd.read_csv(table, dtype={"trajectory": str})).to_csv(table, index=False)
    description = (path / "dataset.toml").read_text().replace("[runs]\n", "")
    (path / "dataset.toml").write_text(description + toml)
    return path


@pytest.mark.parametrize("format", ["csv", "csv.gz", "parquet"])
def test_what_is_written_comes_back_bit_for_bit(tmp_path, format):
    awkward = toy(("001", "NA", "nan", "b c"))
    awkward.runs[0].states[2:4, 2] = -0.0  # the sign of a zero counts in the fingerprint
    write_dataset(awkward, tmp_path, format)
    back = read_dataset(tmp_path)
    assert back.fingerprint == awkward.fingerprint
    assert [r.id for r in back.runs] == ["001", "NA", "nan", "b c"]
    assert (back.source, back.licence, back.simulation, back.notes) == ("formula", "MIT", "toy", ("a note",))
    assert back.runs[1].meta == RunMeta(manoeuvre="weave")


def test_environment_channels_and_noise_come_back_bit_for_bit(tmp_path):
    rng = np.random.default_rng(0)
    names = (*COMMANDS, "wind_speed", "wind_from", "depth")
    run = Run("w", np.arange(9) * 0.1, rng.standard_normal((9, 10)), rng.standard_normal((9, 7)), names)
    noisy = Dataset("noisy", TOY_SHIP, 0.1, (run,), actuators="commanded")
    write_dataset(noisy, tmp_path, "csv.gz")
    assert read_dataset(tmp_path).fingerprint == noisy.fingerprint


def test_writing_another_format_leaves_no_stale_table(tmp_path):
    write_dataset(toy(("a", "b", "c")), tmp_path, "parquet")
    write_dataset(toy(("a", "b")), tmp_path, "csv")
    assert len(read_dataset(tmp_path)) == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dataset.toml", "ship.toml", "trajectories.csv"]


@pytest.mark.parametrize(
    ("signal", "unit", "value", "ours"),
    [
        ("x", "nmi", 1, 1852),
        ("u", "km/h", 3.6, 1),
        ("r", "deg/min", 180 * 60, np.pi),
        ("n", "rad/s", 2 * np.pi, 60),
        ("F_s", "tf", 1, 9806.65),
    ],
)
def test_a_unit_has_its_textbook_factor(signal, unit, value, ours):
    assert value * unit_factor(signal, unit) == pytest.approx(ours, rel=1e-12)


def test_a_command_with_its_own_unit_keeps_it(tmp_path):
    read = read_dataset(folder_with(tmp_path, lambda t: t.assign(n=t.n / 60), '\n[units]\nn = "rev/s"\nn_c = "rpm"\n'))
    np.testing.assert_allclose(read.runs[0].states[:, 6], 90.0)
    np.testing.assert_allclose(read.runs[0].inputs[:, 0], 90.0)


def test_an_actuator_filled_from_its_command_is_in_our_units_too(tmp_path):
    edit = lambda t: t.drop(columns="n").assign(n_c=t.n_c / 60)  # noqa: E731
    read = read_dataset(folder_with(tmp_path, edit, '\n[units]\nn_c = "rev/s"\n'))
    np.testing.assert_allclose(read.runs[0].states[:, 6], 90.0)
    assert any("n is not recorded" in note for note in read.notes)


@pytest.mark.parametrize("kept", ["wind_speed", "wind_from"])
def test_half_a_wind_is_said(tmp_path, kept):
    read = read_dataset(folder_with(tmp_path, lambda t: t.assign(**{kept: 1.0})))
    assert [note for note in read.notes if note.startswith(f"{kept} is recorded alone")]


def test_a_wrapped_heading_becomes_continuous_inside_a_run_only(tmp_path):
    psi = np.deg2rad(np.tile([170.0, 178, -174, -166, -158, -150, -142], 2))
    read = read_dataset(folder_with(tmp_path, lambda t: t.assign(psi=psi)))
    for run in read.runs:
        np.testing.assert_allclose(np.rad2deg(run.states[:, 2]), [170, 178, 186, 194, 202, 210, 218])


def _spoil(column: str, value: object) -> Edit:
    return lambda t: t.astype({column: object}).assign(**{column: lambda s: s[column].where(s.index != 3, value)})


def _raw(name: str, content: bytes) -> Callable[[Path], None]:
    def replace(folder: Path) -> None:
        (folder / "trajectories.csv").unlink()
        (folder / name).write_bytes(content)

    return replace


def _torn_gz(folder: Path) -> None:
    packed = bytearray(gzip.compress((folder / "trajectories.csv").read_bytes()))
    packed[40:120] = bytes(80)
    _raw("trajectories.csv.gz", bytes(packed))(folder)


def _lines(change: Callable[[str], str]) -> Callable[[Path], object]:
    return lambda folder: (folder / "trajectories.csv").write_text(change((folder / "trajectories.csv").read_text()))


def _toml(folder: Path, old: str, new: str) -> None:
    text = (folder / "dataset.toml").read_text()
    assert old in text
    (folder / "dataset.toml").write_text(text.replace(old, new))


BAD: dict[str, tuple[Edit | None, str, Callable[[Path], object] | None, str]] = {
    "column misspelt": (lambda t: t.rename(columns={"psi": "Psi"}), "", None, "Did you mean 'Psi'"),
    "infinite": (_spoil("u", np.inf), "", None, "u is inf"),
    "text and a gap": (
        lambda t: _spoil("u", "fast")(t).assign(u=lambda s: s.u.where(s.index != 1)),
        "",
        None,
        "u is 'fast'",
    ),
    "NaN in time": (_spoil("t", np.nan), "", None, "nan s"),
    "interleaved runs": (lambda t: t.sort_values(["t", "trajectory"]), "", None, "rows of run 'a' are in 7 places"),
    "a run's name twice": (
        lambda t: pd.concat([t, t[t.trajectory == "a"]]),
        "",
        None,
        "rows of run 'a' are in 2 places",
    ),
    "one name for all": (lambda t: t.assign(trajectory="a"), "", None, "t goes from 6 s to 0 s"),
    "a row without a name": (
        lambda t: t.assign(trajectory=t.trajectory.where(t.index != 2)),
        "",
        None,
        "row 4 has no run name",
    ),
    "column map from nowhere": (None, '\n[columns]\nspeed = "u"\n', None, "'speed'"),
    "column map to nowhere": (None, '\n[columns]\nu = "speed"\n', None, "'speed'"),
    "two columns for one": (lambda t: t.assign(a=0.0), '\n[columns]\na = "x"\n', None, "two columns are 'x'"),
    "a header twice": (
        None,
        "",
        _lines(lambda s: s.replace("F_s_c\n", "F_s_c,x\n", 1).replace("\n", ",0\n").replace("x,0", "x", 1)),
        "two columns are 'x'",
    ),
    "metadata of no run": (None, '\n[runs.zz]\ngroup = "g"\n', None, "'zz'"),
    "unknown key": (None, "\n[unit]\n", None, "unit: Extra inputs"),
    "dt as text": (None, "", lambda f: _toml(f, "dt = 1.0", 'dt = "1"'), "dt: .*not text"),
    "dt as truth value": (None, "", lambda f: _toml(f, "dt = 1.0", "dt = true"), "dt: .*not true or false"),
    "dt without end": (None, "", lambda f: _toml(f, "dt = 1.0", "dt = inf"), "dt: .*finite"),
    "scale as text": (None, '\n[scale]\nu = "2"\n', None, "scale.u: .*not text"),
    "bias as truth value": (None, "\n[bias]\nu = true\n", None, "bias.u: .*not true or false"),
    "delay beyond the run": (None, "\n[delay]\nu = 1e8\ndelta_c = 1e8\n", None, "leave no two samples"),
    "antenna as texts": (
        None,
        "",
        lambda f: _toml(f, "dt = 1.0", 'dt = 1.0\nantenna = ["1", 2]'),
        "antenna.0: .*not text",
    ),
    "notes of numbers": (None, "", lambda f: _toml(f, "notes = [", "notes = [3, "), "notes.0: "),
    "a cut that ends before it begins": (
        None,
        "\n[runs.a]\ncut = [[4, 2]]\n",
        None,
        r"\[runs.a\] cut.0: .*such as \[2, 4\]",
    ),
    "a fill that ends before it begins": (
        None,
        "\n[runs.a]\nfill = {r = [[4, 2]]}\n",
        None,
        "fill.r.0: .*ends before it begins",
    ),
    "a cut of texts": (None, '\n[runs.a]\ncut = [["1", "2"]]\n', None, "cut.0.0: .*not text"),
    "a cut without an end": (None, "\n[runs.a]\ncut = [[1]]\n", None, "cut.0.1: "),
    "a run as a number": (None, "\n[runs]\na = 3\n", None, "runs.a: "),
    "no dt": (None, "", lambda f: _toml(f, "dt = 1.0\n", ""), "dt: Field required"),
    "no dataset.toml": (None, "", lambda f: (f / "dataset.toml").unlink(), "cannot read .*dataset.toml"),
    "two tables": (None, "", lambda f: (f / "trajectories.csv.gz").write_bytes(b""), "accepted: one table"),
    "binary gzip": (None, "", _raw("trajectories.csv.gz", bytes(range(256))), "cannot be read"),
    "damaged gzip": (None, "", _torn_gz, "cannot be read"),
    "binary parquet": (None, "", _raw("trajectories.parquet", bytes(range(256))), "cannot be read"),
    "more fields than headers": (
        None,
        "",
        _lines(lambda s: s.replace("\n", ",1\n").replace("F_s_c,1", "F_s_c", 1)),
        "cannot be read",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_one_message(tmp_path, case):
    edit, toml, damage, message = BAD[case]
    folder = folder_with(tmp_path, edit, toml)
    if damage is not None:
        damage(folder)
    with pytest.raises(InputError, match=message) as caught:
        read_dataset(folder)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_written_is_said_and_leaves_the_old_files(tmp_path):
    write_dataset(toy(), tmp_path / "d")
    odd = toy().with_runs([Run("a", r.t, r.states, r.inputs, COMMANDS, {"when": None}) for r in toy(("a",)).runs])
    with pytest.raises(InputError, match="Metadata may hold"):
        write_dataset(odd, tmp_path / "d")
    assert len(read_dataset(tmp_path / "d")) == 2
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        write_dataset(toy(), tmp_path / "file")
    with pytest.raises(InputError, match=r"csv\.gz, csv or parquet"):
        write_dataset(toy(), tmp_path / "d", "xlsx")  # type: ignore[arg-type]


def test_an_interrupted_write_leaves_the_old_table_whole(tmp_path, monkeypatch):
    write_dataset(toy(), tmp_path, "csv")
    calls = itertools.count()
    monkeypatch.setattr(
        os,
        "replace",
        lambda *a: (_ for _ in ()).throw(OSError(28, "No space left on device")) if next(calls) == 0 else None,
    )
    with pytest.raises(InputError, match="No space left"):
        write_dataset(toy(("z",)), tmp_path, "csv")
    monkeypatch.undo()
    assert read_dataset(tmp_path).fingerprint == toy().fingerprint
