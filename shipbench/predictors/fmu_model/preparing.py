"""Preparation of an FMU: its kind, its library for this platform (compiled where there is none), its plan."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...errors import InputError
from . import archive
from .description import CO_SIMULATION, MODEL_EXCHANGE, Description, Variable
from .mapping import Mapping
from .plan import Plan

_STEP = 0.1
"""Step [s] of model exchange where the model description has none."""
_EVEN = 1e-6
_COMPILE_S = 300.0


class Prepared:
    """Folder with an extracted FMU; it is removed with this object."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="shipbench-fmu-"))
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)


def kind_of(description: Description, wanted: str) -> str:
    """Kind of simulation: the wanted one, or co-simulation, or model exchange.

    Raises:
        InputError: the FMU does not offer it.
    """
    offered = list(description.identifiers)
    if wanted and wanted not in offered:
        raise InputError(f"{description.path}: kind = {wanted}; accepted: {', '.join(offered)}.")
    return wanted or (CO_SIMULATION if CO_SIMULATION in offered else MODEL_EXCHANGE)


def check_platform(description: Description, kind: str) -> None:
    """Refuse an FMU that has neither a library for this platform nor source.

    Raises:
        InputError: it has none.
    """
    names, suffix = archive.here()
    if not description.sources and not set(names) & set(description.platforms):
        raise InputError(
            f"{description.path} has libraries for {', '.join(description.platforms) or 'no platform'} and no source; "
            f"needed: {names[description.version - 2]} ({description.identifiers[kind]}{suffix}). Export it for this "
            "platform, or with its source."
        )


def prepare(description: Description, kind: str) -> Prepared:
    """Extract an FMU, and compile it where it has no library for this platform.

    Raises:
        InputError: it has neither library nor source for this platform, or does not compile.
    """
    names, suffix = archive.here()
    prepared = Prepared()
    archive.extract(description.path, prepared.folder)
    identifier = description.identifiers[kind]
    places = [prepared.folder / "binaries" / name / f"{identifier}{suffix}" for name in names]
    if not any(place.is_file() for place in places):
        check_platform(description, kind)
        if description.sources:
            _compile(description, prepared.folder)
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise InputError(f"{description.path} has no library {identifier}{suffix} for this platform. Export it again.")
    wanted = places[description.version - 2]  # FMPy looks for it under the name of the FMI version
    if not wanted.is_file():
        wanted.parent.mkdir(parents=True, exist_ok=True)
        wanted.symlink_to(found)
    return prepared


def _compile(description: Description, folder: Path) -> None:
    """Compile the source with FMPy and CMake, in a process of its own."""
    code = f"from fmpy.build import build_platform_binary; build_platform_binary({str(folder)!r})"
    paths = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    try:
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=_COMPILE_S, check=False, cwd=folder,
            env={**os.environ, "PATH": paths},  # CMake is installed beside FMPy
        )  # fmt: skip
        why = "" if done.returncode == 0 else " ".join((done.stderr or done.stdout).split())[-300:]
    except (OSError, subprocess.TimeoutExpired) as error:
        why = f"{type(error).__name__}"
    if why:
        raise InputError(
            f"{description.path} has no library for this platform, and its source does not compile: {why}. Export it "
            "for this platform."
        )


def plan_of(
    description: Description,
    mapping: Mapping,
    parameters: Sequence[tuple[Variable, float, float, float]],
    kind: str,
    prepared: Prepared,
    dt: float,
    step: float = 0.0,
) -> Plan:
    """Plan of a prepared FMU for the sample time `dt` [s].

    Args:
        parameters: open ones, whose values are set last.
        step: wanted step [s], 0 for the default one.

    Raises:
        InputError: `dt` is no multiple of the step.
    """
    own = description.step if math.isfinite(description.step) and description.step > 0.0 else _STEP
    wanted = step or (dt if kind == CO_SIMULATION else min(own, dt))
    substeps = max(1, round(dt / wanted) if step else math.ceil(dt / wanted - _EVEN))
    if step and abs(substeps * step - dt) > _EVEN * dt:
        raise InputError(
            f"{description.path}: step = {step:g} s; accepted: a whole part of the sample time of the data, {dt:g} s, "
            f"such as {dt / math.ceil(dt / step):.4g}."
        )
    set_first = [link.variable for link in mapping.start] + [v for v, _ in mapping.constants]
    set_refs, input_refs, output_refs = (
        np.array([v.reference for v in variables], dtype=np.uint32)
        for variables in (
            [*set_first, *(p[0] for p in parameters)],
            [link.variable for link in mapping.inputs],
            [link.variable for link in mapping.outputs],
        )
    )
    return Plan(
        str(prepared.folder), description.version, kind, description.identifiers[kind], description.token, set_refs,
        input_refs, output_refs,        dt, substeps, description.states, description.events, description.completes,
    )  # fmt: skip
