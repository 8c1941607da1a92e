"""Benchmark of ship-motion prediction. The names below are loaded when they are first used, so that the import is
quick."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import (
        benchmark,
        check_data,
        diagnose,
        export_model,
        import_log,
        propose_mapping,
        report,
        simulate_like,
    )
    from .bench.limits import fit_band, predict_band
    from .bench.runner import run_tasks
    from .bench.submissions import read_results
    from .bench.task import Task, load_tasks
    from .contract.check import check_model
    from .data.base import DATASETS, load_dataset
    from .errors import InputError, ShipbenchError, WorkError
    from .leaderboard.pages import build_board, write_boards
    from .metrics.base import METRICS
    from .predictors.base import PREDICTORS, Predictor, PredictorBase, make_predictor
    from .records import Batch, Dataset, Run
    from .run_meta import RunMeta
    from .scores import Scores
    from .ship import Ship
    from .specs import parse_spec

    __version__: str

_HOME = {
    "benchmark": "api", "check_data": "api", "diagnose": "api", "export_model": "api", "import_log": "api",
    "propose_mapping": "api", "report": "api", "simulate_like": "api", "Scores": "scores",
    "build_board": "leaderboard.pages", "write_boards": "leaderboard.pages", "read_results": "bench.submissions",
    "fit_band": "bench.limits", "predict_band": "bench.limits",
    "run_tasks": "bench.runner", "Task": "bench.task", "load_tasks": "bench.task", "check_model": "contract.check",
    "DATASETS": "data.base", "load_dataset": "data.base",
    "InputError": "errors", "ShipbenchError": "errors", "WorkError": "errors", "METRICS": "metrics.base",
    "PREDICTORS": "predictors.base", "Predictor": "predictors.base", "PredictorBase": "predictors.base",
    "make_predictor": "predictors.base", "parse_spec": "specs",
    "Batch": "records", "Dataset": "records", "Run": "records", "RunMeta": "run_meta", "Ship": "ship",
}  # fmt: skip

__all__ = [
    "DATASETS", "METRICS", "PREDICTORS", "Batch", "Dataset", "InputError", "Predictor", "PredictorBase", "Run",
    "RunMeta", "Scores", "Ship",
    "ShipbenchError", "Task", "WorkError", "__version__", "benchmark", "build_board", "check_data", "check_model",
    "diagnose", "export_model", "fit_band", "import_log",
    "load_dataset", "load_tasks", "make_predictor", "parse_spec", "predict_band", "propose_mapping", "read_results",
    "report",
    "run_tasks", "simulate_like", "write_boards",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("shipbench")
    if name not in _HOME:
        raise AttributeError(f"module 'shipbench' has no attribute '{name}'")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
