"""Plain C: the model as a folder with model.c, model.h and a test. It needs the C library's mathematics only."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from ..storage import write_text
from .language import ARITHMETIC, comment, statements
from .step import STATE_CHANNELS, TOLERANCE, Channel, Step

FILES = frozenset({"model.c", "model.h", "test.c", "README.txt"})
"""Files of the folder."""
_FORMULAS = ARITHMETIC | {
    "FABS": "fabs({0})", "POW": "pow({0}, {1})", "CONSTPOW": "pow({0}, {1})",
    "LT": "({0} < {1} ? 1.0 : 0.0)", "LE": "({0} <= {1} ? 1.0 : 0.0)", "EQ": "({0} == {1} ? 1.0 : 0.0)",
    "NE": "({0} != {1} ? 1.0 : 0.0)", "NOT": "({0} == 0.0 ? 1.0 : 0.0)",
    "AND": "({0} != 0.0 && {1} != 0.0 ? 1.0 : 0.0)", "OR": "({0} != 0.0 || {1} != 0.0 ? 1.0 : 0.0)",
    "IF_ELSE_ZERO": "({0} != 0.0 ? {1} : 0.0)",
}  # fmt: skip
_HEAD = """#include "model.h"

#include <math.h>

/* not a number stays so, other than in fmin and fmax */
static double lower_(double a, double b) { return a < b || a != a ? a : b; }
static double upper_(double a, double b) { return a > b || a != a ? a : b; }
static double side_(double a) { return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : 0.0; }
"""
_TEST = """/* Compares the model with a trajectory that shipbench predicted; ends with 0 where they agree. */
#include "model.h"

#include <math.h>
#include <stdio.h>

#define STEPS {steps}
static const double s0[{states}] = {{{s0}}};
static const double inputs[STEPS][{inputs}] = {{
{U}
}};
static const double expected[STEPS][{states}] = {{
{S}
}};

int main(void) {{
  double z[{prefix}_MEMORY], s[{states}], largest = 0.0;
  {name}_start(s0, inputs[0], z);
  for (int k = 0; k < STEPS; k++) {{
    {name}_step(z, inputs[k], {prefix}_DT, z, s);
    for (int i = 0; i < {states}; i++) {{
      double size = fabs(expected[k][i]) > 1.0 ? fabs(expected[k][i]) : 1.0;
      double error = fabs(s[i] - expected[k][i]) / size;
      if (!(error <= {tolerance!r})) {{
        printf("FAILED: step %d, state %d: %.17g, expected %.17g\\n", k, i, s[i], expected[k][i]);
        return 1;
      }}
      if (error > largest) largest = error;
    }}
  }}
  printf("ok: {steps} steps, largest relative difference %.2g\\n", largest);
  return 0;
}}
"""
_README = """{name}: a ship model exported by shipbench

  model.c  the model, C99, needs the mathematics library only
  model.h  its two functions, all channels with units, the equations
  test.c   compares it with a trajectory that shipbench predicted

Compile and run the test:

  gcc -std=c99 -O2 -o test test.c model.c -lm && ./test

Options that change arithmetic, such as -ffast-math, change the last digits.
"""


def write(step: Step, name: str, folder: Path) -> None:
    """Write model.c, model.h, test.c and README.txt into a folder."""
    write_text(folder / "model.c", source(step, name))
    write_text(folder / "model.h", header(step, name))
    write_text(folder / "test.c", _test(step, name))
    write_text(folder / "README.txt", _README.format(name=name))


def source(step: Step, name: str) -> str:
    """Text of model.c."""
    start = _function(step.start, ("s0[{}]", "u[{}]"), ("z[{}]",), ())
    moved = _function(step.step, ("z[{}]", "u[{}]", "h"), ("out_z[{}]", "s[{}]"), (f"out_z[{len(step.memory)}]",))
    copied = f"  for (int i = 0; i < {len(step.memory)}; i++) z_next[i] = out_z[i];\n"
    return (
        f"{_HEAD}\nvoid {name}_start(const double *s0, const double *u, double *z) {{\n{start}"
        f"  (void)u;\n}}\n\nvoid {name}_step(const double *z, const double *u, double h, double *z_next, double *s) "
        f"{{\n{moved}{copied}  (void)h;\n}}\n"
    )


def _function(function: ca.Function, inputs: Sequence[str], outputs: Sequence[str], own: Sequence[str]) -> str:
    """Body of a function in C; `own` are declared beside the work variables."""
    lines = statements(function, _FORMULAS, inputs, outputs)
    used = sorted({int(number) for line in lines for number in re.findall(r"\ba(\d+)\b", line)})
    declared = ", ".join([*(f"a{i}" for i in used), *own])
    return "\n".join(f"  {line}" for line in [f"double {declared};", *lines]) + "\n"


def header(step: Step, name: str) -> str:
    """Text of model.h."""
    prefix = name.upper()
    any_step = "any time up to" if step.any_step else "always"
    text = "\n".join(
        [
            f"{name}: motion of the ship '{step.model.ship.name}', exported by shipbench.",
            "Angles in rad, shaft speed in rpm, everything else in SI units.",
            "",
            f"States s[{len(STATE_CHANNELS)}]:",
            *_rows(STATE_CHANNELS),
            f"Inputs u[{len(step.inputs)}], held over a step:",
            *_rows(step.inputs),
            f"Memory z[{len(step.memory)}], what is carried from step to step:",
            *_rows(step.memory),
            "",
            step.model.describe(),
        ]
    )
    return (
        f"/*\n{comment(text, ' * ')}\n */\n#ifndef {prefix}_H\n#define {prefix}_H\n\n"
        f"#define {prefix}_STATES {len(STATE_CHANNELS)}\n#define {prefix}_INPUTS {len(step.inputs)}\n"
        f"#define {prefix}_MEMORY {len(step.memory)}\n#define {prefix}_DT {step.model.dt!r} /* sample time [s] */\n\n"
        "/* Memory z at the start, from the states s0 and the first inputs u. */\n"
        f"void {name}_start(const double *s0, const double *u, double *z);\n\n"
        f"/* One step of h seconds ({any_step} {prefix}_DT) under the inputs u: memory z_next and states s after it.\n"
        " * z_next may be z itself. */\n"
        f"void {name}_step(const double *z, const double *u, double h, double *z_next, double *s);\n\n"
        f"#endif\n"
    )


def _rows(channels: Sequence[Channel]) -> list[str]:
    return [f"  [{i}] {c.name} [{c.unit}]: {c.meaning}" for i, c in enumerate(channels)]


def _test(step: Step, name: str) -> str:
    found = step.reference

    def numbers(row: np.ndarray) -> str:
        return ", ".join(repr(float(value)) for value in row)

    def rows(values: np.ndarray) -> str:
        return ",\n".join(f"  {{{numbers(row)}}}" for row in values)

    return _TEST.format(
        name=name, prefix=name.upper(), steps=len(found.U), states=len(STATE_CHANNELS), inputs=len(step.inputs),
        s0=numbers(found.s0), U=rows(found.U), S=rows(found.S), tolerance=TOLERANCE,
    )  # fmt: skip
