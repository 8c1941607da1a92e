"""Rollouts of a step that is written once, as machine code, and single steps over many lanes.

A step x' = f(x, w, p) comes as a CasADi function, traced from the one formula. Where a C compiler is at hand its
instructions are written as C in which every number is a vector over runs (CasADi's own C code treats one run at a time
and calls scalar sine and cosine), compiled once, and kept in the cache folder under the digest of source, compiler and
processor. Elsewhere CasADi interprets the same instructions: slower, the same numbers to rounding.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from .kept_code import machine_code

if TYPE_CHECKING:
    import casadi

_LANES_ARGUMENTS = (ctypes.c_void_p, ctypes.c_longlong, *[ctypes.c_void_p] * 4)

_HEAD = """
#include <math.h>
#if defined(__AVX512F__)
#define W 8
#elif defined(__AVX__)
#define W 4
#else
#define W 2
#endif
typedef double v __attribute__((vector_size(8 * W)));
typedef long long m __attribute__((vector_size(8 * W)));
#define K(c) ((v){0} + (c))
#define SEL(c, a, b) ((v)(((m)(c) & (m)(a)) | (~(m)(c) & (m)(b))))
#if defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#if __GLIBC_PREREQ(2, 35)
#define SIMD __attribute__((simd("notinbranch")))
SIMD double sin(double); SIMD double cos(double); SIMD double exp(double);
SIMD double log(double); SIMD double tanh(double);
SIMD double atan2(double, double); SIMD double pow(double, double);
#endif
#endif
#define LANES _Pragma("omp simd") for (int l = 0; l < W; l++)
#define ONE(f) static inline v v##f(v a) { v y; LANES y[l] = f(a[l]); return y; }
#define TWO(f) static inline v v##f(v a, v b) { v y; LANES y[l] = f(a[l], b[l]); return y; }
ONE(sin) ONE(cos) ONE(exp) ONE(log) ONE(tanh) ONE(sqrt) TWO(atan2) TWO(pow)
"""
_LANES = """
typedef long long num;
static void fetch(v *to, const double *from, num size, num across, num along, num n) {
  for (num i = 0; i < size; i++, from += along)
    if (across) for (num l = 0; l < W; l++) to[i][l] = from[(l < n ? l : n - 1) * across];
    else to[i] = K(*from);
}
void lanes(const num *shape, num carried, const double *const *in, const num (*by)[5], double *out, const num *out_by) {
  static const num SIZES[] = {SIZES_IN};
  // d is inside, where results lie beside each other; outside where k is carried
  const num outside = carried ? shape[0] : 1, inside = carried ? 1 : shape[0];
  for (num o = 0; o < outside; o++) for (num b = 0; b < shape[2]; b += W) {
    const num n = shape[2] - b < W ? shape[2] - b : W;
    v g[NG], c[NC + 1], y[NY];
    for (num k = 0; k < shape[1]; k++) for (num i = 0; i < inside; i++) {
      const num d = o + i;
      for (num s = 0; s < shape[3]; s++) {
        num fresh = 0;
        v *to = g;
        for (num j = 0; j < NI; to += SIZES[j++]) {  // what is the same as before is not read again
          const num first = !s && ((!k && !i) || (inside > 1 && by[j][0]) || (!i && by[j][1]));
          if (j || NY != SIZES[0] ? first || by[j][3] : !s && (!k || !carried)) {
            fetch(to, in[j] + d * by[j][0] + k * by[j][1] + b * by[j][2] + s * by[j][3], SIZES[j], by[j][2], by[j][4],
                  n);
            fresh |= j != ALONE;
          }
        }
        if (fresh || NY == SIZES[0]) common(g, c);
        step(g, c, y);
        if (NY == SIZES[0]) for (num i = 0; i < NY; i++) g[i] = y[i];
      }
      for (num l = 0; l < n; l++)
        for (num i = 0; i < NY; i++)
          out[d * out_by[0] + k * out_by[1] + (b + l) * out_by[2] + i * out_by[3]] = y[i][l];
    }
  }
}
"""
_C = {
    "ASSIGN": "{0}", "ADD": "{0} + {1}", "SUB": "{0} - {1}", "MUL": "{0} * {1}", "DIV": "{0} / {1}", "NEG": "-{0}",
    "INV": "1.0 / {0}",
    "SQ": "{0} * {0}", "TWICE": "{0} + {0}", "FABS": "SEL({0} < 0, -{0}, {0})", "SQRT": "vsqrt({0})",
    "SIN": "vsin({0})", "COS": "vcos({0})",
    "EXP": "vexp({0})", "LOG": "vlog({0})", "TANH": "vtanh({0})", "ATAN2": "vatan2({0}, {1})", "POW": "vpow({0}, {1})",
    "CONSTPOW": "vpow({0}, {1})",
    # not a number stays so
    "FMIN": "SEL(({0} < {1}) | ({0} != {0}), {0}, {1})", "FMAX": "SEL(({0} > {1}) | ({0} != {0}), {0}, {1})",
    "LT": "SEL({0} < {1}, K(1), K(0))", "LE": "SEL({0} <= {1}, K(1), K(0))", "EQ": "SEL({0} == {1}, K(1), K(0))",
    "NE": "SEL({0} != {1}, K(1), K(0))", "NOT": "SEL({0} == 0, K(1), K(0))",
    "AND": ("SEL(({0} != 0) & ({1} != 0), "
            "K(1), K(0))"),
    "OR": "SEL(({0} != 0) | ({1} != 0), K(1), K(0))", "IF_ELSE_ZERO": "SEL({0} != 0, {1}, K(0))",
    "SIGN": "SEL({0} > 0, K(1), SEL({0} < 0, K(-1), K(0)))",
}  # fmt: skip


class Rollout:
    """Repetition of a step over many runs.

    Args:
        step: x' = step(x (nx,), w (nw,), p) in SX; p is shared by all runs.
        machine_code: whether compiling it, up to some seconds, is worth while.
    """

    def __init__(self, step: casadi.Function, machine_code: bool = True) -> None:
        self.nx, self.nw, self.num = (step.numel_in(i) for i in range(3))
        self._step = step
        self._lanes = Lanes.of(step) if machine_code else None
        self._interpreted = cache(lambda steps: step.mapaccum("roll", steps))

    @property
    def compiled(self) -> bool:
        """Whether it runs as machine code; else CasADi interprets it."""
        return self._lanes is not None

    def __call__(self, x0: np.ndarray, w: np.ndarray, p: np.ndarray, substeps: int = 1) -> np.ndarray:
        """States (runs, K, nx) at t_1..t_K from x0 (runs, nx), `substeps` steps a sample under inputs w (runs, K, nw)
        held over it; p (num,)."""
        x0, w, p = (np.ascontiguousarray(a, dtype=float) for a in (x0, w, p))
        runs, samples = w.shape[:2]
        if x0.shape != (runs, self.nx) or w.shape[2] != self.nw or p.shape != (self.num,):
            raise ValueError(
                f"shapes {x0.shape}, {w.shape}, {p.shape}; accepted: (runs, {self.nx}), (runs, samples, {self.nw}), "
                f"({self.num},)"
            )
        if self._lanes is None:
            return self._interpret(x0, np.repeat(w, substeps, axis=1), p)[:, substeps - 1 :: substeps]
        X = np.empty((runs, samples, self.nx))
        self._lanes(
            [x0[:, None], np.swapaxes(w, 0, 1)[:, :, None], p],
            (1, samples, runs, substeps),
            np.swapaxes(X, 0, 1)[None],
            carried=True,
        )
        return X

    def _interpret(self, x0: np.ndarray, w: np.ndarray, p: np.ndarray) -> np.ndarray:
        """States (runs, steps, nx) after every step."""
        X, values = np.empty((*w.shape[:2], self.nx)), np.tile(p, w.shape[1])
        made: Any = self._interpreted(w.shape[1])
        buffer, trigger = (
            made.buffer()
        )  # reads and writes arrays in place; a call with arrays would copy number by number
        buffer.set_arg(2, values.data)
        for start, inputs, out in zip(x0, w, X, strict=True):
            buffer.set_arg(0, start.data)
            buffer.set_arg(1, inputs.data)
            buffer.set_res(0, out.data)
            trigger()
        return X


class Lanes:
    """Function of bundles of numbers, evaluated over lanes (D, K, B) in S parts each, with numpy's broadcasting but
    without its loops.

    Where it has as many results as the first bundle has numbers it is a step: the parts follow each other, and so do
    the K where they are `carried`.

    Args:
        sizes: of the bundles.
        num: of results.
        compiled: the machine code; see `of`.
    """

    def __init__(self, sizes: tuple[int, ...], num: int, compiled: Callable[..., Any]) -> None:
        self.sizes, self.num, self._compiled = sizes, num, compiled

    @classmethod
    def of(cls, function: casadi.Function, alone: int | None = None) -> Lanes | None:
        """Lanes of a function in SX, one vector per bundle, to one vector. None where there is no compiler, or it holds
        an operation that is not known: use the formula itself. alone: a bundle that often is the only one to change
        along D; what does not depend on it is then computed once for all D."""
        compiled = machine_code(c_source(function, alone), "lanes", _LANES_ARGUMENTS)
        return (
            None
            if compiled is None
            else cls(tuple(function.numel_in(i) for i in range(function.n_in())), function.numel_out(0), compiled)
        )

    def __call__(
        self, given: Sequence[np.ndarray], shape: tuple[int, int, int, int], out: np.ndarray, carried: bool = False
    ) -> None:
        """Write `out` (D, K, B, num) from bundles that spread over (D, K, B, S, size), shape = (D, K, B, S); (D, 1, B,
        num) keeps the last of K."""
        spread = [
            np.broadcast_to(np.asarray(a, dtype=float), (*shape, size))
            for a, size in zip(given, self.sizes, strict=True)
        ]
        if out.shape not in ((*shape[:3], self.num), (shape[0], 1, shape[2], self.num)) or out.dtype != float:
            raise ValueError(f"out: {out.dtype} {out.shape}; accepted: float64 {(*shape[:3], self.num)}")
        pointers = np.array([a.ctypes.data for a in spread], dtype=np.uintp)
        by = np.array(
            [[s // 8 for s in a.strides] for a in (*spread, np.broadcast_to(out, (*shape[:3], self.num))[..., None])],
            dtype=np.int64,
        )
        size = np.array(shape, dtype=np.int64)
        self._compiled(
            size.ctypes.data, carried, pointers.ctypes.data, by.ctypes.data, out.ctypes.data, by[-1].ctypes.data
        )


def c_source(function: casadi.Function, alone: int | None = None) -> str | None:
    """C code of `Lanes`; None where the function holds an operation that is not known here."""
    sizes = [function.numel_in(i) for i in range(function.n_in())]
    found = _instructions(function, [f"g[{sum(sizes[:i])} + {{}}]" for i in range(len(sizes))], alone)
    if found is None:
        return None
    first, then, kept = ("\n".join(lines) for lines in found)
    head = (
        f"#define NI {len(sizes)}\n#define NG {sum(sizes)}\n#define NY {function.numel_out(0)}\n"
        f"#define SIZES_IN {', '.join(map(str, sizes))}\n"
        f"#define NC {len(found[2])}\n#define ALONE {-1 if alone is None else alone}\n"
    )
    steps = (
        f"static void common(const v *g, v *c) {{\n{first}\n{kept}\n}}\n"
        f"static void step(const v *g, const v *c, v *y) {{\n{then}\n}}\n"
    )
    return f"{_HEAD}{head}{steps}{_LANES}"


def operations(function: casadi.Function) -> Iterator[tuple[str, list[int], list[int], float]]:
    """Instructions of a function in SX, in order: operation ("ADD"), its operands, its result, and the value of a
    constant. Operands and result are work variables; an INPUT has (argument, element) as operands, an OUTPUT as its
    result."""
    import casadi

    names = {number: name[3:] for name, number in vars(casadi).items() if name.startswith("OP_")}
    for k in range(function.n_instructions()):
        name = names[function.instruction_id(k)]
        value = function.instruction_constant(k) if name == "CONST" else math.nan
        yield name, function.instruction_input(k), function.instruction_output(k), value


def _instructions(
    function: casadi.Function, places: Sequence[str], alone: int | None
) -> tuple[list[str], list[str], list[str]] | None:
    """Instructions of the function in C, its inputs taken from `places`: those that do not depend on the input `alone`,
    the others, and what the first keep for these."""
    first, then, kept = list[str](), list[str](), list[str]()
    now, changes, known = dict[int, str](), set[str](), dict[str, str]()  # `now`: what a place of CasADi's memory holds

    def taken(place: int, late: bool) -> str:
        value = now[place]
        if not late or value in changes or not value.startswith("a"):
            return value
        if value not in known:
            known[value] = f"c[{len(kept)}]"
            kept.append(f"{known[value]} = {value};")
        return known[value]

    for k, (name, given, out, value) in enumerate(operations(function)):
        if name == "CONST" and math.isfinite(value):
            now[out[0]] = f"K({value!r})"
        elif name == "INPUT":
            now[out[0]] = places[given[0]].format(given[1])
            changes |= {now[out[0]]} if given[0] == alone else set()
        elif name == "OUTPUT":
            then.append(f"y[{out[1]}] = {taken(given[0], late=True)};")
        elif name in _C:
            late = alone is None or any(now[place] in changes for place in given)
            line = f"const v a{k} = {_C[name].format(*(f'({taken(place, late)})' for place in given))};"
            (then if late else first).append(line)
            now[out[0]] = f"a{k}"
            changes |= {f"a{k}"} if late else set()
        else:
            return None
    return first, then, kept


def c_function(code: str, name: str, arguments: Sequence[Any]) -> Callable[..., Any] | None:
    """Compiled C function for other modules that handles vectors `v` of W numbers, with the preamble of this module;
    None where there is no compiler."""
    return machine_code(_HEAD + code, name, arguments)
