"""A part of benchmarks/fuzz_inputs.py: mutated inputs end in a result or in one message, in the readers and through the
command line."""

from __future__ import annotations

import contextlib
import gzip
import importlib.util
import io
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as some
from scipy.io import savemat

from shipbench.data.files import read_dataset
from shipbench.data.mat import read_mat
from shipbench.errors import InputError
from shipbench.regular_files import read_json, read_npz
from shipbench.toml_files import read_toml

spec = importlib.util.spec_from_file_location(
    "fuzz_inputs", Path(__file__).parent.parent / "benchmarks" / "fuzz_inputs.py"
)
fuzz_inputs = importlib.util.module_from_spec(spec)
sys.modules["fuzz_inputs"] = fuzz_inputs
if sys.platform != "win32":
    spec.loader.exec_module(fuzz_inputs)

DRAWN = settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
SHIP = 'name = "toy"\nL = 50.0\nB = 8.0\nT = 3.0\nmass = 9e5\n'
HEAD = "trajectory,t,x,y,psi,u,v,r\n"


def npz() -> bytes:
    file = io.BytesIO()
    np.savez(file, a=np.arange(3.0), b=np.array(["x"]))
    return file.getvalue()


def mat() -> bytes:
    file = io.BytesIO()
    savemat(file, {"dataset": {"name": "a", "dt": 1.0}, "runs": {"id": "r", "t": np.arange(3.0)}})
    return file.getvalue()


VALID = {
    "a.toml": (b'dt = 1.0\n[a.b]\nc = [1, "x", {d = 2}]\n', read_toml),
    "a.json": (b'{"a": [1, 2.5, "x", null], "b": {"c": true}}', read_json),
    "a.npz": (npz(), read_npz),
    "a.mat": (mat(), read_mat),
}


@pytest.mark.parametrize("name", VALID)
@DRAWN
@given(seed=some.integers(0, 2**32 - 1), times=some.integers(1, 4))
def test_a_reader_of_flipped_bytes_gives_a_result_or_one_message(tmp_path, name, seed, times):
    content, read = VALID[name]
    rng = np.random.default_rng(seed)
    for _ in range(times):
        content = fuzz_inputs.flipped(content, rng)
    (tmp_path / name).write_bytes(content)
    with contextlib.suppress(InputError):
        read(tmp_path / name)


WORDS = some.one_of(
    some.floats().map(repr), some.integers().map(str), some.booleans().map(lambda b: str(b).lower()),
    some.sampled_from(fuzz_inputs.TOML[:14]),
    some.lists(some.floats(width=16), max_size=3).map(lambda values: f"[{', '.join(map(repr, values))}]"),
    some.just('"text"'),
)  # fmt: skip
KEYS = some.sampled_from(
    [
        "dt",
        "current",
        "antenna",
        "notes",
        "ship",
        "derived",
        "scale",
        "bias",
        "delay",
        "units",
        "signs",
        "columns",
        "runs",
        "gaps",
        "frame",
    ]
)


@DRAWN
@given(
    entries=some.dictionaries(KEYS, WORDS, min_size=1, max_size=3),
    cell=some.one_of(some.floats().map(repr), some.text(max_size=8)),
    packed=some.booleans(),
)
@example(entries={"dt": "true"}, cell="0", packed=False)
@example(entries={}, cell="1e308", packed=True)
def test_a_data_set_of_drawn_values_is_read_rightly_or_refused(tmp_path, entries, cell, packed):
    keys = {"name": '"toy"', "dt": "1.0", "actuators": '"measured"'} | entries
    (tmp_path / "dataset.toml").write_text(
        "".join(f"{key} = {value}\n" for key, value in keys.items()), encoding="utf-8"
    )
    (tmp_path / "ship.toml").write_text(SHIP)
    rows = "".join(f"a,{t},{cell if t == 2 else t},0,0,1,0,0\n" for t in range(5))
    for old in tmp_path.glob("trajectories*"):
        old.unlink()
    text = (HEAD + rows).encode("utf-8", "surrogatepass")
    (tmp_path / ("trajectories.csv.gz" if packed else "trajectories.csv")).write_bytes(
        gzip.compress(text) if packed else text
    )
    with contextlib.suppress(InputError):
        data = read_dataset(tmp_path)
        assert data.dt == 1.0
        assert all(np.isfinite(run.states).all() for run in data.runs)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_mutated_inputs_of_every_kind_end_well_through_the_command_line(tmp_path):
    told: list[str] = []
    counts = fuzz_inputs.fuzz(3, 20, tmp_path, tell=told.append)
    assert not told
    assert set(counts) == set(fuzz_inputs.KINDS)
    assert sum(found["refused"] for found in counts.values()) > 10
    assert sum(found["ok"] for found in counts.values()) > 3
