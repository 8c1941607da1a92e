"""Where made data sets, downloads and compiled code are kept."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """The environment variable SHIPBENCH_CACHE, else ~/.cache/shipbench."""
    return Path(os.environ.get("SHIPBENCH_CACHE") or Path.home() / ".cache" / "shipbench")
