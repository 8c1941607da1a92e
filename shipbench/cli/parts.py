"""The commands that list and explain the parts of models: `models`, `effects`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import InputError, unknown_name
from .common import Json, print_json, say, say_wrapped, screen_width, show_table

_Name = Annotated[str | None, typer.Argument(metavar="[NAME]", help="Explain this one (default: list all).")]
_COLUMN = 13


def models(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="Explain this one, or an FMU (default: list all)."),
    ] = None,
    propose: Annotated[
        Path | None, typer.Option("--propose", help="With an FMU: write a draft of its mapping, and do nothing else.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the draft of --propose.")] = False,
    as_json: Json = False,
) -> None:
    """List the models with their parameters, or explain one."""
    if name is not None and name.endswith(".fmu"):
        from .fmu import explain_fmu, propose_mapping

        propose_mapping(Path(name), propose, force, as_json) if propose else explain_fmu(Path(name), as_json)
        return
    if propose is not None:
        raise InputError("--propose serves an FMU; accepted: shipbench models ship.fmu --propose ship.fmu.toml")
    from ..predictors.registered import PREDICTORS
    from ..reports.listing import describe_parts, explain_part

    parts = describe_parts(PREDICTORS)
    if name is not None:
        part = _chosen("model", name, parts)
        _model(part, *explain_part(PREDICTORS, name), as_json)
        return
    if as_json:
        print_json(parts)
        return
    for part in parts:
        origin = "" if part["from"] == "shipbench" else f"  [{part['from']}]"
        say_wrapped(f"{part['name']:<{_COLUMN - 1}s} {part['summary']}{origin}", hanging=" " * _COLUMN)
        if part["parameters"]:
            say_wrapped(", ".join(_assigned(part["parameters"])), " " * _COLUMN)
        if part["unusable"]:
            say_wrapped(f"NOT USABLE HERE: {part['unusable']}", " " * _COLUMN)
    say("")
    say_wrapped(
        "A spec sets parameters in brackets, such as 'mlp[hidden=64,seed=3]'. Your own class: "
        "path/to/model.py:ClassName."
    )
    say_wrapped("To explain one: shipbench models NAME")


def _assigned(parameters: dict[str, str]) -> list[str]:
    return [f"{key}={value}" if value else key for key, value in parameters.items()]


def _chosen(kind: str, name: str, parts: list[dict[str, Any]]) -> dict[str, Any]:
    found = {part["name"]: part for part in parts}
    if name not in found:
        raise unknown_name(kind, name, found)
    return found[name]


def _model(part: dict[str, Any], about: list[str], meanings: dict[str, str], as_json: bool) -> None:
    """Lines on a model: description, parameters with their defaults, and a command that uses it."""
    if as_json:
        print_json(part | {"about": about, "meanings": meanings})
        return
    for text in (f"{part['name']}: {part['summary']}", *about):
        say_wrapped(text)
        say("")
    say("Parameters with their defaults:" if part["parameters"] else "It has no parameters.")
    assigned = _assigned(part["parameters"])
    wide = max(map(len, assigned), default=0) + 4
    for key, text in zip(part["parameters"], assigned, strict=True):
        say_wrapped(f"  {text:<{wide - 2}s}{meanings.get(key, '')}", hanging=" " * wide)
    if part["unusable"]:
        say_wrapped(f"NOT USABLE HERE: {part['unusable']}")
    say("\nExample:")
    example = {"predictions": "predictions:theirs", "fmu": "path/ship.fmu"}.get(part["name"], part["name"])
    say(f"  shipbench run --model {example} --dataset demo --horizon 60")


def effects(name: _Name = None, as_json: Json = False) -> None:
    """List the effects that a diagnosis can name and a model spec can add (physics+current), or explain one."""
    from ..reports.listing import describe_effects

    parts = describe_effects()
    if name is not None:
        _effect(_chosen("effect", name, parts), as_json)
        return
    if as_json:
        print_json(parts)
        return
    for part in parts:
        say_wrapped(f"{part['name']:<26s}{part['family']:<13s}{part['summary']}", hanging=" " * 26)
        for line in _sizes(part):
            say_wrapped(line, " " * 28)
    say("")
    say_wrapped("Sizes are for a ship of 130 m. They scale with her length by Froude's law.")
    say_wrapped("Add one to the physics: --model physics+current. To explain one: shipbench effects NAME")


def _sizes(part: dict[str, Any]) -> list[str]:
    from ..render.table import display_unit
    from ..reports.diagnosis.text import figure

    lines = []
    for p in part["parameters"]:
        unit, factor = display_unit(p["unit"])
        typical, low, high = (figure(factor * p[key]) for key in ("typical", "low", "high"))
        lines.append(f"{p['name']} [{unit}], typical {typical}, from {low} to {high}")
    return lines


def _effect(part: dict[str, Any], as_json: bool) -> None:
    """Lines on an effect: description, sizes with units, source, the trial that separates it, and a command that uses
    it."""
    from ..effects.base import EFFECTS
    from ..render.table import Table, TableColumn, display_unit, significant
    from ..render.terminal import command_lines

    effect = EFFECTS.get(part["name"])
    if as_json:
        print_json(part | {"separate": effect.separate})
        return
    say_wrapped(f"{part['name']} ({part['family']}): {part['summary']}.")
    say("")
    rows = []
    for p in part["parameters"]:
        unit, factor = display_unit(p["unit"])
        rows.append({"name": p["name"], "unit": unit, **{key: factor * p[key] for key in ("typical", "low", "high")}})
    columns = [TableColumn("size", "name"), TableColumn("unit", "unit"),
        TableColumn("typical", "typical", significant(3)),
               TableColumn("least", "low", significant(3)),
               TableColumn("greatest", "high", significant(3))]  # fmt: skip
    if rows:
        show_table(Table("Sizes for a ship of 130 m", columns, rows, ["They scale with the length by Froude's law."]))
        say("")
    if part["per_run"]:
        say("Every run has its own values.")
    if effect.separate:
        say_wrapped(f"Trial that separates it: {effect.separate}.")
    if effect.channels:
        say_wrapped(f"It needs the recorded channels {', '.join(effect.channels)}.")
    say_wrapped(f"Source: {part['source']}.")
    say("\nExample:")
    if effect.traits.describes_data:
        say("  shipbench diagnose demo")
    else:
        command = f"shipbench run --model physics --model physics+{part['name']} --dataset demo --horizon 60"
        say("\n".join(command_lines(command, screen_width())))


def register(app: typer.Typer) -> None:
    """Add these commands to the command line."""
    app.command()(models)
    app.command()(effects)
