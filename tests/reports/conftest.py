"""The results that pages are made of."""

from __future__ import annotations

from pathlib import Path

import pytest
from hostile import run_study


@pytest.fixture(scope="session")
def study(tmp_path_factory) -> Path:
    """Results of four models, one of which fails and one diverges, on runs with hostile names."""
    return run_study(tmp_path_factory.mktemp("report"))
