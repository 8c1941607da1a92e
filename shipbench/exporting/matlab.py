"""MATLAB and Octave: one function S = name(s0, U) without toolboxes."""

from __future__ import annotations

from pathlib import Path

from ..storage import write_text
from .language import ARITHMETIC, comment, statements
from .step import STATE_CHANNELS, Step

_FORMULAS = ARITHMETIC | {
    "FABS": "abs({0})", "POW": "{0} ^ {1}", "CONSTPOW": "{0} ^ {1}", "LT": "double({0} < {1})",
    "LE": "double({0} <= {1})", "EQ": "double({0} == {1})", "NE": "double({0} ~= {1})", "NOT": "double({0} == 0)",
    "AND": "double({0} ~= 0 && {1} ~= 0)", "OR": "double({0} ~= 0 || {1} ~= 0)",
    "IF_ELSE_ZERO": "chosen_({0}, {1})",
}  # fmt: skip
_BODY = """function S = {name}(s0, U)
{help}
  if nargin ~= 2 || numel(s0) ~= {states} || size(U, 2) ~= {inputs} || isempty(U)
    error('{name}:arguments', 's0 must have {states} elements and U {inputs} columns; see help {name}');
  end
  K = size(U, 1);
  S = zeros(K, {states});
  z = start_(s0, U(1, :));
  for k = 1:K
    [z, S(k, :)] = step_(z, U(k, :), {dt!r});
  end
end

function z = start_(s0, u)
  z = zeros(1, {memory});
{start}
end

function [z_next, s] = step_(z, u, h)
  z_next = zeros(1, {memory});
  s = zeros(1, {states});
{step}
end

function y = lower_(a, b)
  if a < b || a ~= a, y = a; else, y = b; end
end

function y = upper_(a, b)
  if a > b || a ~= a, y = a; else, y = b; end
end

function y = side_(a)
  y = double(a > 0) - double(a < 0);
end

function y = chosen_(condition, a)
  if condition ~= 0, y = a; else, y = 0; end
end
"""


def write(step: Step, name: str, path: Path) -> None:
    """Write the function `name` to the file `path`, whose stem must be `name`."""
    write_text(path, source(step, name))


def source(step: Step, name: str) -> str:
    """Text of the .m file."""

    def rows(channels) -> list[str]:
        return [f"  {i}  {c.name} [{c.unit}]: {c.meaning}" for i, c in enumerate(channels, 1)]

    text = "\n".join(
        [
            f"{name.upper()}  Motion of the ship '{step.model.ship.name}', exported by shipbench.",
            f"  S = {name}(s0, U) returns the states S (K x {len(STATE_CHANNELS)}) at t = dt, 2 dt, .., K dt from the "
            f"state s0 at t = 0 under the inputs U (K x {len(step.inputs)}), each row held for dt = {step.model.dt!r} "
            "s.",
            "  Angles in rad, shaft speed in rpm, everything else in SI units.",
            "",
            "  Columns of S, and elements of s0:",
            *rows(STATE_CHANNELS),
            "  Columns of U:",
            *rows(step.inputs),
            "",
            step.model.describe(),
        ]
    )
    start = statements(step.start, _FORMULAS, ("s0({})", "u({})"), ("z({})",), first=1)
    moved = statements(step.step, _FORMULAS, ("z({})", "u({})", "h"), ("z_next({})", "s({})"), first=1)
    return _BODY.format(
        name=name, help=comment(text, "%"), states=len(STATE_CHANNELS), inputs=len(step.inputs), dt=step.model.dt,
        memory=len(step.memory), start="\n".join(f"  {line}" for line in start),
        step="\n".join(f"  {line}" for line in moved),
    )  # fmt: skip
