"""Nothing is unpickled from files: a result folder or a saved model of somebody else runs no code of theirs."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import numpy as np
import pytest

from shipbench.bench.results import Cell, read_predictions
from shipbench.errors import InputError
from shipbench.predictors.base import make_predictor, parse_spec

PACKAGE = Path(__file__).parent.parent / "shipbench"
LOADERS = {"load", "loads", "Unpickler", "read_pickle", "read_hdf"}
FROM_MEMORY = {"bench/answering.py", "bench/isolate.py", "bench/executors.py"}
"""Pipes between our own processes, and a copy in memory."""


class Bomb:
    """Leaves a trace when it is unpickled."""

    def __reduce__(self):
        return (Path.touch, (Path("unpickled"),))


def test_only_pipes_and_copies_in_memory_are_unpickled():
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                if node.value.id in ("pickle", "joblib", "cloudpickle", "torch", "dill") and node.attr in LOADERS:
                    found.add(path.relative_to(PACKAGE).as_posix())
                assert node.attr not in ("read_pickle", "read_hdf"), path
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert isinstance(node.value, ast.Constant), path
                assert node.value.value is False, path
    assert found <= FROM_MEMORY


def test_pickles_in_saved_models_and_results_are_refused_and_not_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trap = np.array([Bomb()], dtype=object)
    Path("saved").mkdir()
    Path("saved/model.json").write_text(
        json.dumps({"predictor": "hold", "params": {}, "inputs": [], "meta": {"dt": 1.0}})
    )
    np.savez("saved/arrays.npz", trap=trap)
    with pytest.raises(InputError, match=r"saved is not a saved model, or it is damaged: .* holds Python objects"):
        make_predictor(parse_spec("saved"))
    cell = Cell("toy", "hold", 0, 0)
    cell.folder.mkdir(parents=True)
    np.savez(cell.folder / "predictions.npz", S=trap)
    with pytest.raises(InputError, match="Python objects"):
        read_predictions(Path(), cell)
    assert not Path("unpickled").exists()
