"""Data sets by name or by folder; those that take long to make are kept in a cache."""

from __future__ import annotations

import hashlib
import inspect
import json
import logging
import os
import shlex
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..cache import cache_folder, make_private, stranger
from ..errors import InputError, ShipbenchError, unknown_name, unknown_parameter
from ..names import file_name
from ..records import Dataset
from ..registry import Registry
from ..regular_files import read_text
from ..specs import parse_spec
from ..storage import put
from .public import PublicData

_HELPERS = frozenset({
    "base", "corrections", "coverage", "describe", "export", "files", "mat", "noise", "public", "reread", "sensitivity",
    "trajectories", "units",
})  # fmt: skip
DATASETS = Registry("data set", "data", "DATASET", helpers=_HELPERS, group="datasets")

LOG_SUFFIXES = (".csv", ".csv.gz", ".parquet", ".mat", ".xlsx", ".txt", ".tsv", ".dat", ".log")
"""Suffixes of files that `data import` may read."""
_LEFT_S = 3600.0
"""Age [s] after which an unfinished data set counts as abandoned: the largest takes a minute."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class DatasetPart:
    """Named data set: function that makes it, licence, whether to keep it in the cache, and its download address if
    there is one.

    A change that alters the samples of a cached set gets a new `version` (and, once published, a new name).
    """

    name: str
    summary: str
    licence: str
    make: Callable[..., Dataset]
    cached: bool
    version: str = "1"
    public: PublicData | None = None


def public_folder(name: str) -> Path:
    """Folder of the downloaded files of a public data set."""
    return cache_folder() / "public" / file_name(name)


def load_dataset(spec: str | os.PathLike[str], *, remake: bool = False, **options: Any) -> Dataset:
    """Load a data set by registered name, `name[key=value]`, or the path of a folder in the contract's format (or of a
    .mat file that was exported).

    Args:
        spec: name, folder or .mat file; a folder is recognised by its dataset.toml.
        remake: make a cached set anew.
        options: parameters of a registered set, beside those in the brackets.

    Raises:
        InputError: neither a known name nor a data set's folder, an unknown parameter, or faulty files.
    """
    from .files import read_dataset  # pandas is loaded for reading and writing, not for the list
    from .mat import is_export, read_mat

    spec = os.fspath(spec)
    folder = Path(spec)
    exported = folder.suffix == ".mat" and os.path.lexists(folder) and not os.path.isdir(folder)
    if folder.is_file() and not (exported and is_export(folder)):
        raise _no_data_set(spec, folder)
    if exported or os.path.lexists(folder / "dataset.toml"):
        if options:
            raise InputError(f"{folder} is read from files and takes no parameters; given: {', '.join(options)}.")
        return read_mat(folder) if exported else read_dataset(folder)
    if (
        os.path.isdir(folder) and spec not in DATASETS
    ):  # `shipbench demo` makes a folder of results with the name of a data set
        files = "trajectories.csv (or .csv.gz, .parquet), dataset.toml and ship.toml"
        raise InputError(f"folder {folder} holds no dataset.toml; a data set has {files}.{_logs_within(folder)}")
    parsed = parse_spec(spec)
    if parsed.name not in DATASETS:
        raise unknown_name("folder or data set", parsed.name, DATASETS.names())
    if parsed.effects or parsed.path is not None:
        raise InputError(
            f"data set '{spec}': accepted: name, name[key=value,...] or a folder; effects (+name) belong to models."
        )
    part: DatasetPart = DATASETS.get(parsed.name)
    params = parsed.params | options
    _check_params(part, params)
    if not part.cached:
        return _make(part, params)
    folder = cache_folder() / _cache_key(part, params)
    if not remake and (found := _from_cache(folder)) is not None:
        return found
    dataset = _make(part, params)
    _to_cache(dataset, folder)
    return dataset


def import_command(*logs: Path) -> str:
    """Command that makes a data set of logs."""
    return f"shipbench data import {' '.join(shlex.quote(str(log)) for log in logs)} --propose mapping.toml"


def _no_data_set(spec: str, file: Path) -> InputError:
    """Advice in place of a file that is no data set."""
    if os.path.lexists(file.parent / "dataset.toml"):
        return InputError(
            f"'{spec}' is one file of a data set; accepted: its folder. Give {shlex.quote(str(file.parent))}."
        )
    if file.name.lower().endswith(LOG_SUFFIXES):
        return InputError(f"'{spec}' is a log, not a data set yet. Start with: {import_command(file)}")
    return InputError(
        f"'{spec}' is a file; accepted: a registered name, or a folder with dataset.toml. A log: {import_command(file)}"
    )


def _logs_within(folder: Path) -> str:
    """Hint where a folder holds logs."""
    log = next((p for p in sorted(folder.iterdir()) if p.is_file() and p.name.lower().endswith(LOG_SUFFIXES)), None)
    return "" if log is None else f" To make one of a log: {import_command(log)}"


def _check_params(part: DatasetPart, params: dict[str, Any]) -> None:
    accepted = inspect.signature(part.make).parameters
    if not any(p.kind is p.VAR_KEYWORD for p in accepted.values()):
        for key in params.keys() - accepted.keys():
            raise unknown_parameter(f"data set '{part.name}'", key, accepted)


def _make(part: DatasetPart, params: dict[str, Any]) -> Dataset:
    try:
        return part.make(**params)
    except (TypeError, ValueError) as error:
        if not params:  # then it is no fault of the user's
            raise
        given = ", ".join(f"{k}={v}" for k, v in params.items())
        raise InputError(
            f"data set '{part.name}' cannot be made with {given}: {error}. Parameters are written name[key=value]."
        ) from error


def _cache_key(part: DatasetPart, params: dict[str, Any]) -> str:
    """Folder name; digests keep apart what any readable form of the parameters might confuse, and the versions of a
    plug-in."""
    text = json.dumps(params, sort_keys=True, default=str)
    plugin = DATASETS.digest(part.name)
    digest = [hashlib.sha256(text.encode()).hexdigest()[:12]] if params else []
    return "-".join((file_name(part.name), f"v{part.version}", *([plugin] if plugin else []), *digest))


def _from_cache(folder: Path) -> Dataset | None:
    """Cached data set, or None where there is none or it is damaged (reported in the log, then made anew)."""
    from .files import read_dataset

    if not os.path.lexists(folder):
        return None
    if reason := stranger(folder):
        advice = "Set SHIPBENCH_CACHE to a folder of your own that only you can write."
        _log.warning("the cached data set %s is not used: %s; it is made anew. %s", folder, reason, advice)
        return None
    try:
        dataset = read_dataset(folder)
        promised = read_text(folder / "fingerprint.txt").strip()
    except ShipbenchError as error:
        _log.warning("the cached data set %s cannot be read (%s); it is made anew", folder, error)
        return None
    if dataset.fingerprint != promised:
        _log.warning(
            "the cached data set %s is damaged (fingerprint %s, promised %s); it is made anew",
            folder,
            dataset.fingerprint,
            promised,
        )
        return None
    return dataset


def _clear(folder: Path) -> None:
    """Remove any file or folder in the place of a cached data set."""
    if folder.is_dir() and not folder.is_symlink():
        shutil.rmtree(folder)
    else:
        folder.unlink(missing_ok=True)


def _to_cache(dataset: Dataset, folder: Path) -> None:
    """Write beside the cache, then move: a reader gets a whole data set or none. A cache that cannot be written costs
    time, not results."""
    from .files import write_dataset

    fresh: Path | None = None
    try:
        make_private()
        for left in folder.parent.glob(".making-*"):  # by a process that was killed
            if time.time() - left.stat().st_mtime > _LEFT_S:
                _clear(left)
        fresh = Path(tempfile.mkdtemp(prefix=".making-", dir=folder.parent))
        write_dataset(dataset, fresh, format="parquet")
        (fresh / "fingerprint.txt").write_text(dataset.fingerprint)
        _clear(folder)
        put(fresh, folder)
    except (ShipbenchError, OSError) as error:
        _log.warning(
            "the data set '%s' cannot be kept in %s (%s); it will be made again next time",
            dataset.name,
            folder.parent,
            error,
        )
        if fresh is not None:
            shutil.rmtree(fresh, ignore_errors=True)
