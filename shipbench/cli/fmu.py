"""Explanation of an FMU and draft of its mapping, for `shipbench models ship.fmu`."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path

from ..errors import InputError
from ..names import brief
from .common import print_json, say, say_wrapped, screen_width

_LONGEST = 80
"""Most characters of a name that is printed."""
_TABLES = {"input": "Inputs", "output": "Outputs", "parameter": "Parameters"}


def explain_fmu(path: Path, as_json: bool) -> None:
    """Print what an FMU offers: kinds, platforms, variables with units and bounds, and its mapping."""
    from ..predictors.fmu_model.description import read_description
    from ..predictors.fmu_model.mapping import mapping_of
    from ..predictors.fmu_model.preparing import check_platform, kind_of

    found = read_description(path)
    try:
        mapping_of(found)
        fault = ""
    except InputError as error:
        fault = str(error)
    try:
        check_platform(found, kind_of(found, ""))
        unfit = ""
    except InputError as error:
        unfit = str(error)
    if as_json:
        rows = {kind: [_row(asdict(v)) for v in found.of(kind)] for kind in _TABLES}
        print_json({"name": found.name, "fmi": found.version, "kinds": list(found.identifiers),
                    "platforms": found.platforms, "sources": found.sources, "mapping": fault or "complete",
                    "runs_here": not unfit, **rows})  # fmt: skip
        return
    places = ", ".join(found.platforms) or "no platform"
    source = ", with its source" if found.sources else ""
    say_wrapped(f"{found.name}: FMI {found.version}, {' and '.join(found.identifiers)}, for {places}{source}")
    for kind, title in _TABLES.items():
        say(f"\n{title}:")
        for v in found.of(kind):
            start = "" if math.isnan(v.start) else f" = {v.start:g}"
            bounds = "" if math.isnan(v.low) or math.isnan(v.high) else f", from {v.low:g} to {v.high:g}"
            words = f"  {v.description}" if v.description else ""
            say_wrapped(f"  {brief(v.name, _LONGEST)} [{v.unit or '-'}]{start}{bounds}{words}", hanging="    ")
    say("")
    say_wrapped(f"To be completed: {fault}" if fault else "Its mapping is complete.")
    if unfit:
        say_wrapped(f"It does not run here: {unfit}")
        return
    say(f"\nExample:\n  shipbench run --model {path} --dataset demo --horizon 60")


def _row(variable: dict[str, object]) -> dict[str, object]:
    """Values for JSON, which has no NaN."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in variable.items()}


def propose_mapping(path: Path, target: Path, force: bool, as_json: bool) -> None:
    """Write a draft mapping and print what is missing in it, and the next command."""
    from ..importing.propose.fmu import write_fmu_proposal
    from ..render.terminal import command_lines

    *remarks, command = write_fmu_proposal(path, target, force)
    if as_json:
        print_json({"mapping": str(target), "remarks": remarks, "next": command})
        return
    for line in remarks:
        say_wrapped(line)
    say(f"Written: {target}. Read it and correct it; then:")
    say("\n".join(command_lines(command, screen_width())))
