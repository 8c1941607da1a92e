"""Results on disk: one folder per study, one sub-folder per cell (data set, model, fold, seed), written whole or not at
all.

- `study.json`: tasks, command, code, machine, times.
- `rows.parquet`: one row per (dataset, model, fold, seed, run) of the study.
- `summary.json`: one entry per cell that alone identifies its experiment.
- `windows.parquet`: one row per scored window: what the true ship does there (see `regimes`). These three files are a
submission.
- `truth/<dataset>/fold0.npz`: ids, s0, U and truth of the scored windows (the same for all models).
- `cells/<dataset>/<model>/fold0-seed0/`: rows.parquet, summary.json, predictions.npz (S, and W with bands),
equations.txt, model/ (with its band.json, see `predictors/_band`).
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..names import file_name
from ..predictors._band import BAND_FILE, Band, band_text
from ..records import Batch
from ..regular_files import open_regular, read_json, read_npz
from ..signals import COMMANDS, STATES
from ..storage import Frame, in_one_step, put, write_json, write_rows
from .regimes import window_features
from .scoring import measure

PROTOCOL = 1
"""Version of the definition of the scores. A change that alters a published score raises it; rows of different
protocols are never ranked together."""

STATUSES = ("ok", "diverged", "failed", "skipped")
"""Statuses of a row. `skipped`: the model does not predict the window, by what it is."""
_MOST_ROWS = 10_000_000
"""Most rows of a table of results; 200 models on 10,000 runs have 2 million."""
_WHOLE = "Give the folder that `shipbench run` wrote, whole."


def whole_status(statuses: Sequence[str]) -> str:
    """Status of a cell from those of its rows: that of all, else "diverged" where one is, else "ok"."""
    return statuses[0] if len(set(statuses)) == 1 else "diverged" if "diverged" in statuses else "ok"


@dataclass(frozen=True)
class Cell:
    """Unit of work: data set, model, fold and seed."""

    dataset: str
    model: str
    fold: int
    seed: int

    @property
    def label(self) -> str:
        """Label for messages."""
        return f"{self.dataset} {self.model} fold {self.fold} seed {self.seed}"

    @property
    def folder(self) -> Path:
        """Folder relative to the study's."""
        return Path("cells", file_name(self.dataset), file_name(self.model), f"fold{self.fold}-seed{self.seed}")


def write_truth(out: Path, dataset: str, fold: int, batch: Batch) -> None:
    """Save the truth against which every model of this fold is scored."""
    path = truth_path(out, dataset, fold)
    if path.parent.is_symlink():
        raise InputError(
            f"{path.parent} is a link; accepted: a folder, so that a study writes only below {out}. Remove the link."
        )
    with in_one_step(path) as part, part.open("wb") as file:
        np.savez_compressed(file, ids=np.array(batch.ids), s0=batch.s0, U=batch.U, truth=batch.truth)


def truth_path(out: Path, dataset: str, fold: int) -> Path:
    """Path of the saved truth of a fold."""
    return out / "truth" / file_name(dataset) / f"fold{fold}.npz"


def read_truth(out: Path, dataset: str, fold: int) -> Batch:
    """Truth of a fold as `write_truth` saved it, without history.

    Raises:
        InputError: it is not there, is damaged, or its arrays are of other shapes.
    """
    path = truth_path(out, dataset, fold)
    found = _arrays(path, ("ids", "s0", "U", "truth"))
    ids, s0, U, truth = (found[name] for name in ("ids", "s0", "U", "truth"))
    steps = (ids.size, truth.shape[1]) if ids.ndim == 1 and truth.ndim == 3 else (0, 0)
    shapes = (
        s0.shape == (ids.size, len(STATES))
        and truth.shape == (*steps, len(STATES))
        and U.shape[:2] == steps
        and U.ndim == 3
    )
    if (
        not shapes
        or 0 in steps
        or U.shape[2] < len(COMMANDS)
        or ids.dtype.kind != "U"
        or any(a.dtype.kind != "f" for a in (s0, U, truth))
    ):
        raise InputError(
            f"{path}: ids {ids.shape}, s0 {s0.shape}, U {U.shape}, truth {truth.shape} are no truth of windows. "
            f"{_WHOLE}"
        )
    if not all(np.isfinite(a).all() for a in (s0, U, truth)):
        raise InputError(f"{path}: the truth holds values that are not finite. {_WHOLE}")
    return Batch(tuple(ids.tolist()), s0, U, truth)


def read_predictions(out: Path, cell: Cell) -> np.ndarray | None:
    """S (batch, K, 10) of a cell, or None where nothing was predicted (failed, skipped).

    Raises:
        InputError: the file is damaged, or its array is of another shape.
    """
    path = out / cell.folder / "predictions.npz"
    if not path.exists():
        return None
    S = _arrays(path, ("S",))["S"]
    if S.ndim != 3 or S.shape[2] != len(STATES) or S.dtype.kind != "f":
        raise InputError(
            f"{path}: S {S.shape} of {S.dtype} is no prediction; accepted: numbers (batch, K, {len(STATES)}). {_WHOLE}"
        )
    return S


def read_band(out: Path, cell: Cell) -> np.ndarray | None:
    """Half-widths W (batch, K, 6) of the band of a cell, or None where none is saved.

    Raises:
        InputError: the file is damaged, or its array is of another shape than the motion of the prediction.
    """
    path, S = out / cell.folder / "predictions.npz", read_predictions(out, cell)
    if S is None or (W := read_npz(path).get("W")) is None:
        return None
    if W.shape != (*S.shape[:2], 6) or W.dtype.kind != "f":
        raise InputError(
            f"{path}: W {W.shape} of {W.dtype} is no band; accepted: numbers {(*S.shape[:2], 6)}. {_WHOLE}"
        )
    return W


def _arrays(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Arrays of these names in a .npz file."""
    found = read_npz(path)
    if missing := [name for name in names if name not in found]:
        raise InputError(f"{path} lacks {', '.join(missing)}. {_WHOLE}")
    return found


EQUATIONS = "equations.txt"
"""Name of the file of fitted equations in the folder of a cell."""
_CELL_FILES = ("rows.parquet", "summary.json", "predictions.npz", EQUATIONS, "model", BAND_FILE)
"""Files and folders that a study writes into the folder of a cell."""


def beside_model(files: Mapping[str, bytes], band: Band) -> dict[str, bytes]:
    """Files of a cell (content by relative name) with that of a band: in the model's folder, or beside a model that was
    saved as files of another name. A file that the model wrote itself stays; a model that was not saved has none."""
    folder = "model/" if any(name.startswith("model/") for name in files) else ""
    own = {n.removeprefix(folder): found for n, found in files.items() if n.startswith(folder) and n != EQUATIONS}
    return {folder + BAND_FILE: band_text(band, own).encode(), **files} if own else {**files}


def write_cell(
    out: Path, cell: Cell, rows: Frame, summary: dict[str, Any], S: np.ndarray | None, files: Mapping[str, bytes],
    W: np.ndarray | None = None,
) -> None:  # fmt: skip
    """Write a finished cell atomically (an older one is replaced); `files` are further ones, by relative name (saved
    model, equations); W are the half-widths of its band."""
    final = out / cell.folder
    old = final.with_name(f".{final.name}.{os.getpid()}.old.tmp")
    with in_one_step(final) as part:
        part.mkdir(parents=True)
        if S is not None:
            arrays: dict[str, Any] = {"S": S} if W is None else {"S": S, "W": W}
            np.savez_compressed(part / "predictions.npz", **arrays)
        for name, content in files.items():
            (part / name).parent.mkdir(parents=True, exist_ok=True)
            (part / name).write_bytes(content)
        rows.to_parquet(part / "rows.parquet", index=False)
        write_json(part / "summary.json", summary | {"files": _digests(part)})
        if final.exists():  # moved away whole: who is killed in between leaves no cell, never half of one
            put(final, old)
    for extra in (p for p in old.glob("*") if p.name not in _CELL_FILES):  # somebody's own notes stay
        if not (final / extra.name).exists():
            put(extra, final / extra.name)
    shutil.rmtree(old, ignore_errors=True)


def _digests(folder: Path) -> dict[str, str]:
    """SHA-256 (first 16 digits) of the files from which a cell's rows and scores are read."""
    found = (folder / name for name in ("rows.parquet", "predictions.npz"))
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest()[:16] for p in found if p.is_file()}


def read_summary(out: Path, cell: Cell) -> dict[str, Any] | None:
    """Summary of a finished cell, or None if it is not there."""
    path = out / cell.folder / "summary.json"
    return read_json(path) if path.exists() else None


def scored_before(out: Path, cell: Cell, key: str) -> str:
    """Status of a cell that need not be run again ("ok", "diverged"), or "": it is not there, damaged, of another key,
    failed or skipped."""
    try:
        summary = read_summary(out, cell) or {}
        whole = summary.get("key") == key and summary["files"] == _digests(out / cell.folder)
        return summary["status"] if whole and summary["status"] in ("ok", "diverged") else ""
    except (InputError, OSError, KeyError, TypeError, AttributeError):  # a damaged summary may hold anything
        return ""


def assemble(out: Path, cells: Iterable[Cell]) -> tuple[Frame, list[dict[str, Any]]]:
    """Gather the given cells (all finished) of a study into `rows.parquet` and `summary.json`, and return both."""
    import pandas as pd

    done = [(cell, summary) for cell in cells if (summary := read_summary(out, cell)) is not None]
    frames = [pd.read_parquet(out / cell.folder / "rows.parquet") for cell, _ in done]
    rows = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()
    summaries = [summary for _, summary in done]
    write_rows(out / "rows.parquet", rows)
    write_json(out / "summary.json", summaries)
    if summaries:
        write_rows(out / "windows.parquet", window_table(out, summaries))
    return rows, summaries


def window_table(out: Path, summaries: Sequence[dict[str, Any]]) -> Frame:
    """Motion of the true ship in every scored window of a study, from its saved truth: dataset, fingerprint, fold, run
    and `window_features`."""
    import pandas as pd

    frames = []
    for dataset, fold in dict.fromkeys((s["dataset"], s["fold"]) for s in summaries):
        summary = next(s for s in summaries if s["dataset"] == dataset)
        batch = read_truth(out, dataset, fold)
        identity = {
            "dataset": dataset,
            "fingerprint": summary["fingerprint"],
            "task": summary["task_key"],
            "fold": fold,
            "run": list(batch.ids),
        }
        frames.append(pd.DataFrame(identity | window_features(batch, summary["ship_L"])))
    return pd.concat(frames, ignore_index=True)


def read_frame(path: Path) -> Frame:
    """Read a parquet table. The metadata of pandas in the file are ignored: they can be damaged, and decide types.

    Raises:
        InputError: it is no regular file, is damaged, or declares more rows than a study has.
    """
    import pyarrow
    import pyarrow.parquet

    with open_regular(path, "parquet file") as file:
        try:
            table = pyarrow.parquet.ParquetFile(file)
            rows = table.metadata.num_rows
            if rows <= _MOST_ROWS:
                return table.read().replace_schema_metadata().to_pandas()
        except (pyarrow.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
            raise InputError(f"{path} cannot be read ({' '.join(str(error).split())[:160]}). {_WHOLE}") from None
    raise InputError(f"{path} declares {rows} rows; accepted: at most {_MOST_ROWS}. {_WHOLE}")


def rescore(out: Path, summary: dict[str, Any]) -> dict[str, np.ndarray]:
    """Compute every metric of a cell again from its saved predictions and truth (NaN where nothing was predicted)."""
    cell = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"])
    batch, S = read_truth(out, cell.dataset, cell.fold), read_predictions(out, cell)
    ok = np.array([status == "ok" for status in summary["run_status"]])
    S = np.full_like(batch.truth, np.nan) if S is None else S
    W = read_band(out, cell) if summary["task"].get("bands") else None
    return measure(summary["task"]["metrics"], batch, S, L=summary["ship_L"], dt=summary["dt"], ok=ok, W=W)
