"""Products of columns as packed symmetric matrices: their lower triangles alone, with machine code where a compiler is
available.

Row i of a matrix (n, n) holds its first i + 1 numbers, and then those up to the next multiple of eight: half the memory
of the whole, read as vectors. What lies above the diagonal there has no meaning.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np

from ..compiled import c_function

GREATEST = 1e50
"""Greatest value whose products are taken, with room for products of these; a trajectory beyond it has diverged."""
_EIGHT = 8
_CODE = """
#include <stdlib.h>
typedef long long num;
typedef double u __attribute__((vector_size(8 * W), aligned(8)));
#define EACH(i, n) _Pragma("GCC unroll 16") for (int i = 0; i < (n); i++)
#define AT(p) (32 * (p) * ((p) + 1))  // where the rows 8 p begin
static num length(num n) { return AT(n / 8) + 8 * (n / 8 + 1) * (n % 8); }

#define TILE(name, M) \
static void name(const double *a, const double *c, num rows, num wide, num n, double *to, num by) { \
  v s[8][M]; \
  EACH(i, 8) EACH(j, M) s[i][j] = K(0); \
  for (num k = 0; k < rows; k++, a += wide, c += wide) { \
    v t[M]; \
    EACH(j, M) t[j] = *(const v *)(c + j * W); \
    EACH(i, 8) { const v f = K(a[i]); EACH(j, M) s[i][j] += f * t[j]; } \
  } \
  EACH(i, 8) if (i < n) EACH(j, M) *(u *)(to + i * by + j * W) = s[i][j]; \
}
TILE(narrow, 8 / W)
TILE(broad, 16 / W)

void products(num count, num rows, num parts, const double *const *from, const num (*shape)[3], double unit,
              const double *factor, const char *real, double *out) {
  num n = 0;
  for (num j = 0; j < parts; j++) n += shape[j][0];
  const num wide = (n + 7) / 8 * 8;
  double *z = aligned_alloc(64, rows * wide * 8);
  if (!z) abort();
  for (num i = 0; i < rows * wide; i++) z[i] = 0.0;
  for (num b = 0; b < count; b++, real += rows, out += length(n)) {
    for (num k = 0; k < rows; k++) {
      double *to = z + k * wide;
      for (num j = 0; j < parts; to += shape[j++][0]) {
        const double *x = from[j] + b * shape[j][1] + k * shape[j][2];
        for (num i = 0; i < shape[j][0]; i++) {
          const double y = x[i] * unit;
          to[i] = y < GREATEST && y > -GREATEST ? y : 0.0;
        }
      }
    }
    if (factor) for (num i = 0; i < wide; i += 8) for (num k = rows - 1; k >= 0; k--) {
      v s[8 / W];
      EACH(j, 8 / W) s[j] = K(0);
      for (num l = 0; l <= k; l++) EACH(j, 8 / W) s[j] += factor[k * rows + l] * *(v *)(z + l * wide + i + j * W);
      EACH(j, 8 / W) *(v *)(z + k * wide + i + j * W) = s[j];
    }
    for (num k = 0; k < rows; k++) if (!real[k]) for (num i = 0; i < wide; i++) z[k * wide + i] = 0.0;
    for (num p = 0; 8 * p < n; p++) {
      const num some = n - 8 * p < 8 ? n - 8 * p : 8, by = 8 * (p + 1);
      for (num q = 0; q < p; q += 2) broad(z + 8 * p, z + 8 * q, rows, wide, some, out + AT(p) + 8 * q, by);
      if (p % 2 == 0) narrow(z + 8 * p, z + 8 * p, rows, wide, some, out + AT(p) + 8 * p, by);
    }
  }
  free(z);
}

void weighed(num count, num n, num parts, const double *const *from, const double *weights, double *out) {
  for (num b = 0; b < count; b++, out += n * n) {
    num at = b * length(n);
    for (num i = 0; i < n; i++) for (num j = 0; j <= i; j += 8, at += 8) {
      double y[8];
      EACH(l, 8) y[l] = 0.0;
      for (num c = 0; c < parts; c++) EACH(l, 8) y[l] += weights[c] * from[c][at + l];
      const num m = i + 1 - j < 8 ? i + 1 - j : 8;
      for (num l = 0; l < m; l++) out[i * n + j + l] = out[(j + l) * n + i] = y[l];
    }
  }
}

void contracted(num count, num n, num parts, const double *const *from, const double *theta, num inner,
                const double *more, double *sums) {
  double *m = aligned_alloc(64, (length(n) + 8) * 8);
  if (!m) abort();
  for (num c = 0; c < parts; c++) sums[c] = 0.0;
  for (num b = 0; b < count; b++, theta += n, more += inner * inner) {
    double *to = m;
    for (num i = 0; i < n; to += 8 * (i++ / 8 + 1)) {
      for (num j = 0; j < i; j++) to[j] = 2.0 * theta[i] * theta[j];
      to[i] = theta[i] * theta[i];
      for (num j = i + 1; j < 8 * (i / 8 + 1); j++) to[j] = 0.0;
      if (i < inner) {
        for (num j = 0; j < i; j++) to[j] += 2.0 * more[i * inner + j];
        to[i] += more[i * inner + i];
      }
    }
    for (num c = 0; c < parts; c++) {
      const double *x = from[c] + b * length(n);
      v s[4];
      EACH(j, 4) s[j] = K(0);
      num i = 0;
      for (; i + 4 * W <= length(n); i += 4 * W) EACH(j, 4) s[j] += *(const u *)(x + i + j * W) * *(v *)(m + i + j * W);
      for (; i < length(n); i += W) s[0] += *(const u *)(x + i) * *(v *)(m + i);
      s[0] += s[1] + (s[2] + s[3]);
      for (num l = 0; l < W; l++) sums[c] += s[0][l];
    }
  }
  free(m);
}
"""
_POINTER, _NUMBER = ctypes.c_void_p, ctypes.c_longlong


def length(n: int) -> int:
    """Number of values of a packed matrix (n, n)."""
    return _EIGHT * (n // _EIGHT + 1) * (_EIGHT // 2 * (n // _EIGHT) + n % _EIGHT)


@lru_cache(maxsize=64)
def places(n: int) -> np.ndarray:
    """Places (n, n) of the values of a symmetric matrix in its packed form."""
    row, column = np.maximum(*np.indices((n, n))), np.minimum(*np.indices((n, n)))
    return np.asarray(_EIGHT * (row // _EIGHT + 1) * (_EIGHT // 2 * (row // _EIGHT) + row % _EIGHT) + column)


def pack(matrices: np.ndarray) -> np.ndarray:
    """Packed form (..., length) of symmetric matrices (..., n, n)."""
    n = matrices.shape[-1]
    out = np.zeros((*matrices.shape[:-2], length(n)))
    out[..., places(n)] = matrices
    return out


def only(packed: np.ndarray, n: int, keep: np.ndarray) -> np.ndarray:
    """Packed form (B, length) of some rows and columns `keep` of packed matrices (n, n)."""
    found = np.zeros(length(len(keep)), dtype=int)
    found[places(len(keep))] = places(n)[np.ix_(keep, keep)]
    return np.take(packed, found, axis=1)


def products(
    blocks: Sequence[np.ndarray], channel: int, unit: float, factor: np.ndarray | None, real: np.ndarray
) -> np.ndarray | None:
    """Packed products (B, length) of the columns of one channel; None where there is no compiler.

    blocks (B, T, C) have the channel last in T; they are multiplied by `unit`, then by the matrix `factor` (K + 1, K +
    1) from the left, if there is one; samples that are not `real` (B, K + 1) count as zero, and so do values of a
    trajectory that has diverged.
    """
    code = _code("products", _NUMBER, _NUMBER, _NUMBER, _POINTER, _POINTER, ctypes.c_double, *[_POINTER] * 3)
    if code is None:
        return None
    blocks = [b if b.dtype == float and b.strides[2] == b.itemsize else np.ascontiguousarray(b, float) for b in blocks]
    blocks = [b for b in blocks if b.shape[2]]
    (B, rows), size = real.shape, blocks[0].itemsize
    begin = np.array([b.ctypes.data + channel * b.strides[1] for b in blocks], dtype=np.uintp)
    channels = blocks[0].shape[1] // rows
    shape = np.array([[b.shape[2], b.strides[0] // size, channels * b.strides[1] // size] for b in blocks], np.int64)
    out = np.empty((B, length(int(shape[:, 0].sum()))))
    real = np.ascontiguousarray(real)
    matrix = None if factor is None else np.ascontiguousarray(factor)
    code(
        B, rows, len(blocks), begin.ctypes.data, shape.ctypes.data, unit,
        None if matrix is None else matrix.ctypes.data, real.ctypes.data, out.ctypes.data,
    )  # fmt: skip
    return out


def weighed(parts: Sequence[np.ndarray], weights: np.ndarray, n: int) -> np.ndarray:
    """Sum (B, n, n) of packed matrices, one (B, length) each part, times its weight."""
    code = _code("weighed", _NUMBER, _NUMBER, _NUMBER, *[_POINTER] * 3)
    if code is None:
        total = weights[0] * parts[0]
        for part, weight in zip(parts[1:], weights[1:], strict=True):
            total += weight * part
        return np.take(total, places(n), axis=1)
    out, begin = np.empty((len(parts[0]), n, n)), _pointers(parts)
    weights = np.ascontiguousarray(weights)
    code(len(out), n, len(parts), begin.ctypes.data, weights.ctypes.data, out.ctypes.data)
    return out


def contracted(parts: Sequence[np.ndarray], theta: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Sums over the segments of theta' P theta + tr(P' more) of every part, packed P (B, length), with vectors theta
    (B, n) and symmetric matrices `more` (B, m, m) for the first m rows."""
    (B, n), inner = theta.shape, more.shape[-1]
    code = _code("contracted", _NUMBER, _NUMBER, _NUMBER, _POINTER, _POINTER, _NUMBER, _POINTER, _POINTER)
    if code is None:
        second = theta[:, :, None] * theta[:, None, :]
        second[:, :inner, :inner] += more
        lower = pack(np.tril(2.0 * second) - second * np.eye(n))
        return np.array([np.vdot(part, lower) for part in parts])
    theta, more = np.ascontiguousarray(theta), np.ascontiguousarray(more)
    begin, sums = _pointers(parts), np.empty(len(parts))
    code(B, n, len(parts), begin.ctypes.data, theta.ctypes.data, inner, more.ctypes.data, sums.ctypes.data)
    return sums


def _pointers(parts: Sequence[np.ndarray]) -> np.ndarray:
    assert all(part.flags.c_contiguous and part.dtype == float for part in parts)
    return np.array([part.ctypes.data for part in parts], dtype=np.uintp)


@cache
def _code(name: str, *arguments: Any) -> Callable[..., Any] | None:
    return c_function(_CODE.replace("GREATEST", repr(GREATEST)), name, arguments)
