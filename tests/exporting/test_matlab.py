"""The MATLAB function: its statements give the numbers of predict, in Python's reading and in Octave."""

from __future__ import annotations

import math
import re
import shutil
import subprocess

import numpy as np
import pytest
from exporting_cases import CASES, PHYSICS, WHOLE, largest

from shipbench.exporting import matlab
from shipbench.exporting.step import TOLERANCE, step_of

_HELPERS = {
    "lower_": lambda a, b: a if a < b or a != a else b, "upper_": lambda a, b: a if a > b or a != a else b,
    "side_": lambda a: float(a > 0) - float(a < 0), "chosen_": lambda c, a: a if c != 0 else 0.0, "double": float,
    "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "exp": math.exp, "log": math.log, "tanh": math.tanh,
    "atan2": math.atan2, "abs": abs,
}  # fmt: skip


def _function(text: str, name: str):
    """Body of a local function of the file, read as Python: name(i) of an array is name[i]."""
    body = re.search(rf"^function [^\n]* = {name}\([^\n]*\n(.*?)^end$", text, re.DOTALL | re.MULTILINE)
    assert body is not None
    lines = [line.strip().rstrip(";") for line in body[1].splitlines() if "zeros(" not in line]
    lines = [re.sub(r"\b(z_next|z|u|s0|s)\((\d+)\)", r"\1[\2]", line) for line in lines]
    lines = [line.replace("~=", "!=").replace("&&", "and").replace("||", "or").replace("^", "**") for line in lines]
    return compile("\n".join(lines), name, "exec")


def _rollout(text: str, s0, U, dt):
    start, step = _function(text, "start_"), _function(text, "step_")

    def places(values):
        return {i + 1: float(v) for i, v in enumerate(values)}

    names = {"s0": places(s0), "u": places(U[0]), "z": {}, **_HELPERS}
    exec(start, names)
    z, found = names["z"], []
    for u in U:
        names = {"z": z, "u": places(u), "h": dt, "z_next": {}, "s": {}, **_HELPERS}
        exec(step, names)
        z = names["z_next"]
        found.append([names["s"][i + 1] for i in range(10)])
    return np.array(found)


@pytest.mark.parametrize(("spec", "options"), CASES)
def test_its_statements_are_the_model(made, spec, options):
    step = step_of(made(spec, **options))
    found = step.reference
    S = _rollout(matlab.source(step, "ship"), found.s0, found.U, step.model.dt)
    assert largest(S, found.S) < TOLERANCE


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no Octave")
@pytest.mark.long
@pytest.mark.parametrize(("spec", "options"), [PHYSICS[3], WHOLE])
def test_octave_gives_the_same_numbers(made, tmp_path, spec, options):
    step = step_of(made(spec, **options))
    found = step.reference
    matlab.write(step, "ship", tmp_path / "ship.m")
    np.savetxt(tmp_path / "s0.txt", found.s0, fmt="%.17g")
    np.savetxt(tmp_path / "U.txt", found.U, fmt="%.17g")
    script = "S = ship(load('s0.txt'), load('U.txt')); printf([repmat('%.17g ', 1, 10) '\\n'], S')"
    done = subprocess.run(
        ["octave-cli", "-q", "--eval", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert largest(np.array([line.split() for line in done.stdout.splitlines()], float), found.S) < TOLERANCE


def test_every_line_before_the_code_is_a_comment(made):
    model = made("physics")
    model.ship = model.ship.model_copy(update={"name": "a\n%{\nerror('out')\n%}"})
    lines = matlab.source(step_of(model), "ship").splitlines()
    head = lines[1 : next(i for i, line in enumerate(lines) if line.startswith("  if nargin"))]
    assert all(line.startswith("%") and line.strip() not in ("%{", "%}") for line in head)
