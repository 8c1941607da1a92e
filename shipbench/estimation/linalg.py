"""Inverses and determinants of many small positive definite matrices, as machine code where a compiler is available."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ..compiled import c_function

_SWEEPS = """
#include <stdlib.h>
typedef long long num;
void inverses(num count, num size, const double *A, double *inverse, double *logdet) {
  v *a = aligned_alloc(sizeof(v), size * (size + 1) * sizeof(v)), *c = a + size * size;
  if (!a) { *logdet = NAN; return; }
  for (num b = 0; b < count; b += W) {
    const num n = count - b < W ? count - b : W;
    for (num i = 0; i < size; i++) for (num j = 0; j <= i; j++)
      for (num l = 0; l < W; l++) a[i * size + j][l] = A[((b + (l < n ? l : n - 1)) * size + i) * size + j];
    v sum = K(0);
    for (num k = 0; k < size; k++) {
      const v pivot = a[k * size + k], r = 1.0 / pivot;
      sum += vlog(pivot);
      for (num i = 0; i < size; i++) c[i] = i < k ? a[k * size + i] : a[i * size + k];
      c[k] = K(0);
      for (num i = 0; i < size; i++) {
        const v t = c[i] * r;
        v *row = a + i * size;
        for (num j = 0; j <= i; j++) row[j] -= t * c[j];
        if (i < k) a[k * size + i] = t; else row[k] = t;
      }
      a[k * size + k] = -r;
    }
    for (num l = 0; l < n; l++) {
      double *to = inverse + (b + l) * size * size;
      logdet[b + l] = sum[l];
      for (num i = 0; i < size; i++)
        for (num j = 0; j <= i; j++) to[i * size + j] = to[j * size + i] = -a[i * size + j][l];
    }
  }
  free(a);
}
"""
"""Sweep operator (Goodnight, The American Statistician 33 (1979) 149) at every pivot in turn; each number is a vector
over matrices.

LAPACK takes one matrix at a time, and at these sizes its blocks and pivots take most of the time.
"""


def inverses(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (B, n, n) and log determinants (B,) of positive definite matrices. Nearly definite ones (sensitivities
    of a diverging trajectory) are inverted with pivoting."""
    code = _code()
    if code is not None:
        A, out, logdet = np.ascontiguousarray(A), np.empty(A.shape), np.empty(len(A))
        code(*A.shape[:2], A.ctypes.data, out.ctypes.data, logdet.ctypes.data)
        if np.isfinite(logdet).all():  # a pivot that is not positive has no logarithm
            return out, logdet
    return np.linalg.inv(A), log_determinant(A)


def log_determinant(A: np.ndarray) -> np.ndarray:
    """Log determinants of positive definite matrices (..., n, n).

    A Cholesky factorisation takes half the work of one with pivoting, which serves nearly singular matrices.
    """
    try:
        return 2.0 * np.log(np.diagonal(np.linalg.cholesky(A), axis1=-2, axis2=-1)).sum(axis=-1)
    except np.linalg.LinAlgError:
        return np.linalg.slogdet(A)[1]


@cache
def _code() -> Callable[..., Any] | None:
    return c_function(_SWEEPS, "inverses", (*[ctypes.c_longlong] * 2, *[ctypes.c_void_p] * 3))
