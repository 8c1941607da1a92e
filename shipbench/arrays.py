"""Arrays of user code."""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import InputError


def numbers(given: Any, what: str) -> np.ndarray:
    """Array of float64; masked values become NaN.

    Raises:
        InputError: they are no real numbers, or rows differ in length.
    """
    try:
        array = np.ma.filled(given.astype(float), np.nan) if isinstance(given, np.ma.MaskedArray) else np.asarray(given)
    except (ValueError, TypeError) as error:
        raise InputError(f"{what} is no array: {error}. Accepted: an array of real numbers.") from None
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} holds {array.dtype}; accepted: an array of real numbers, such as float64.")
    return array.astype(float, copy=False)
