"""Grids of cases of which the test command runs a part; the long tests run all."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def every(nth: int, values: Iterable[Any]) -> list[Any]:
    """Parameters: every nth value is for every day, the others are long."""
    return [pytest.param(v, marks=[] if i % nth == 0 else pytest.mark.long) for i, v in enumerate(values)]
