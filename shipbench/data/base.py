"""Data sets by name or by folder; the ones that take time to make are kept in a cache."""

from __future__ import annotations

import json
import logging
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, ShipbenchError, unknown_name
from ..records import Dataset
from ..registry import Registry
from ..specs import parse_spec
from .files import read_dataset, write_dataset

DATASETS = Registry("data set", "data", "DATASET", helpers=frozenset({"base", "files", "describe", "units"}))

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class DatasetPart:
    """A named data set: how to make it, under which licence, and whether to keep it in the cache.

    A change that alters the samples of a cached set gets a new `version` (and, once published, a new name).
    """

    name: str
    summary: str
    licence: str
    make: Callable[..., Dataset]
    cached: bool
    version: str = "1"


def cache_folder() -> Path:
    """Where made data sets are kept: the environment variable SHIPBENCH_CACHE, else ~/.cache/shipbench."""
    return Path(os.environ.get("SHIPBENCH_CACHE") or Path.home() / ".cache" / "shipbench")


def load_dataset(spec: str, *, remake: bool = False) -> Dataset:
    """A data set by registered name, `name[key=value]`, or the path of a folder in the contract's format.

    Args:
        spec: name or folder; a folder is recognised by its dataset.toml.
        remake: make a cached set anew.

    Raises:
        InputError: neither a known name nor a data set's folder, an unknown parameter, or faulty files.
    """
    folder = Path(spec)
    if (folder / "dataset.toml").is_file():
        return read_dataset(folder)
    if folder.is_dir():
        raise InputError(f"folder {folder} holds no dataset.toml; a data set has trajectories.csv (or .csv.gz, .parquet), dataset.toml and ship.toml.")
    parsed = parse_spec(spec)
    if parsed.name not in DATASETS.names():
        more = " (nor is it a folder)" if os.sep in spec else ""
        raise unknown_name(f"data set{more}", parsed.name, DATASETS.names())
    part: DatasetPart = DATASETS.get(parsed.name)
    if not part.cached:
        return _make(part, parsed.params)
    folder = cache_folder() / _cache_key(part, parsed.params)
    if not remake and (found := _from_cache(folder)) is not None:
        return found
    dataset = _make(part, parsed.params)
    _to_cache(dataset, folder)
    return dataset


def _make(part: DatasetPart, params: dict[str, Any]) -> Dataset:
    try:
        return part.make(**params)
    except TypeError as error:
        raise InputError(f"data set '{part.name}': {error}. Parameters are written name[key=value].") from None


def _cache_key(part: DatasetPart, params: dict[str, Any]) -> str:
    text = "".join(c if c.isalnum() else "-" for c in json.dumps(params, sort_keys=True)).strip("-")
    return "-".join(filter(None, (part.name, f"v{part.version}", text)))


def _from_cache(folder: Path) -> Dataset | None:
    """The cached data set, or None where there is none or it is damaged (said in the log, then made anew)."""
    if not folder.is_dir():
        return None
    try:
        dataset = read_dataset(folder)
        promised = (folder / "fingerprint.txt").read_text().strip()
    except (ShipbenchError, OSError) as error:
        _log.warning("the cached data set %s cannot be read (%s); it is made anew", folder, error)
        return None
    if dataset.fingerprint != promised:
        _log.warning("the cached data set %s is damaged (fingerprint %s, promised %s); it is made anew", folder, dataset.fingerprint, promised)
        return None
    return dataset


def _to_cache(dataset: Dataset, folder: Path) -> None:
    """Write beside the cache, then move: a reader sees a whole data set or none. A cache that cannot be written costs time, not results."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=".making-", dir=folder.parent))
        write_dataset(dataset, fresh, format="parquet")
        (fresh / "fingerprint.txt").write_text(dataset.fingerprint)
        shutil.rmtree(folder, ignore_errors=True)
        os.replace(fresh, folder)
    except OSError as error:
        _log.warning("the data set '%s' cannot be kept in %s (%s); it will be made again next time", dataset.name, folder.parent, error)
