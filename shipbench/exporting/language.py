"""Instructions of a CasADi function as statements of another language, and text that is safe inside its source.

A name or text of a user becomes source only through `identifier` and `comment`.
"""

from __future__ import annotations

import math
import re
import textwrap
import unicodedata
from collections.abc import Mapping, Sequence

import casadi as ca

from ..compiled import operations
from ..errors import InputError

LONGEST = 63
"""Most characters of an identifier: what MATLAB and C99 tell apart."""
_WIDTH = 110
_ASCII = str.maketrans({"·": "*", "\N{FRACTION SLASH}": "/", "√": "sqrt", "±": "+-", "°": " deg"})
_KEYWORDS = frozenset({
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
})  # fmt: skip
"""Words of MATLAB that name no function; those of C always get a suffix."""


def identifier(text: str) -> str:
    """Legal name of a function in C and MATLAB, and of a variable of an FMU: letters, digits and underscores, the first
    a letter."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    name = name if name[:1].isalpha() and name not in _KEYWORDS else f"m_{name}"
    return name[:LONGEST].rstrip("_")


def comment(text: str, prefix: str) -> str:
    """Lines of a comment, each behind `prefix`, in ASCII, without what would end a comment of C or join its lines."""
    plain = unicodedata.normalize("NFKD", text).translate(_ASCII).encode("ascii", "replace").decode()
    lines = []
    for line in plain.splitlines():
        shown = "".join(c if c.isprintable() else " " for c in line).replace("\\", "/")
        for pair, apart in (("*/", "* /"), ("/*", "/ *"), ("??", "? ")):
            while pair in shown:
                shown = shown.replace(pair, apart)
        indent = " " * (len(shown) - len(shown.lstrip()) + 4)
        lines += textwrap.wrap(shown, _WIDTH, subsequent_indent=indent, drop_whitespace=False) or [""]
    return "\n".join(f"{prefix}{line}".rstrip() for line in lines)


def statements(
    function: ca.Function,
    formulas: Mapping[str, str],
    inputs: Sequence[str],
    outputs: Sequence[str],
    first: int = 0,
) -> list[str]:
    """Statements `a0 = a1 * a2;` of a function in SX, in order.

    Args:
        formulas: operation ("ADD") to a text with {0} and {1}.
        inputs: place of an element of each argument, with {} for its index, such as "z[{}]".
        outputs: place of an element of each result.
        first: index of the first element.

    Raises:
        InputError: it holds an operation or a number that the language has not.
    """
    lines = []
    for name, given, out, value in operations(function):
        if name == "CONST" and math.isfinite(value):
            lines.append(f"a{out[0]} = {value!r};")
        elif name == "INPUT":
            lines.append(f"a{out[0]} = {inputs[given[0]].format(given[1] + first)};")
        elif name == "OUTPUT":
            lines.append(f"{outputs[out[0]].format(out[1] + first)} = a{given[0]};")
        elif name in formulas:
            lines.append(f"a{out[0]} = {formulas[name].format(*(f'a{i}' for i in given))};")
        else:
            what = f"the number {value}" if name == "CONST" else f"the operation {name}"
            raise InputError(
                f"the model's formula holds {what}, which cannot be written as C or MATLAB. "
                "Give --format casadi, or leave the effect out."
            )
    return lines


ARITHMETIC = {
    "ASSIGN": "{0}", "ADD": "{0} + {1}", "SUB": "{0} - {1}", "MUL": "{0} * {1}", "DIV": "{0} / {1}", "NEG": "-{0}",
    "INV": "1.0 / {0}", "SQ": "{0} * {0}", "TWICE": "2.0 * {0}", "SQRT": "sqrt({0})", "SIN": "sin({0})",
    "COS": "cos({0})", "EXP": "exp({0})", "LOG": "log({0})", "TANH": "tanh({0})", "ATAN2": "atan2({0}, {1})",
    "FMIN": "lower_({0}, {1})", "FMAX": "upper_({0}, {1})", "SIGN": "side_({0})",
}  # fmt: skip
"""Operations that C and MATLAB write alike."""
