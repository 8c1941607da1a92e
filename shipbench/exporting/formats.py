"""Formats of `shipbench export`, and the checks that come before one is written."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, option, unknown_name
from ..predictors.base import make_predictor
from ..predictors.physics_model.fitted_ship import FittedShip
from ..specs import parse_spec
from ..storage import exchange
from . import c_code, casadi_function, fmu, force_law, matlab
from .language import identifier
from .step import Step, step_of

FMI = (2, 3)
"""Versions of FMI that an FMU may have."""


@dataclass(frozen=True)
class Format:
    """One format: the end of the file's name ("" for a folder), and the function that writes it."""

    suffix: str
    write: Callable[[Step, str, Path], None]


FORMATS = {
    "fmu": Format(".fmu", fmu.write),
    "c": Format("", c_code.write),
    "casadi": Format(".casadi", casadi_function.write),
    "matlab": Format(".m", matlab.write),
    "json": Format(".json", force_law.write),
}


def export(folder: str, format: str, out: Path | None = None, *, fmi: int = 2, force: bool = False) -> Path:
    """Write the saved model in `folder` in a format, and return the path of the file, or of the folder for "c".

    Args:
        folder: of a saved `physics` or `calibrated`, with or without effects.
        format: a key of `FORMATS`.
        out: file or folder to write; None: named after ship and model, in the current folder.
        fmi: version of FMI of an FMU.
        force: replace what is there.

    Raises:
        InputError: the folder is no saved model or one that cannot be exported, the format is unknown, `out` is there
            already or no name for this format, or an FMU is asked for and there is no C compiler.
        WorkError: the model diverges, or the compiler fails.
    """
    if format not in FORMATS:
        raise unknown_name("format", format, FORMATS)
    if fmi not in FMI:
        raise InputError(f"{option('--fmi', 'fmi=')} {fmi}; accepted: {' or '.join(map(str, FMI))}.")
    model = _saved(folder)
    kind = FORMATS[format]
    name = identifier(_title(model))
    path = Path(f"{name}{kind.suffix or '_c'}") if out is None else out
    if out is not None:
        name = _named_after(out, kind, name)
    _check_target(path, Path(folder), kind, force)
    step = step_of(model)
    if kind.suffix:
        write: Any = kind.write
        write(step, name, path, **({"fmi": fmi} if format == "fmu" else {}))
        return path
    place = path.resolve()
    fresh = place.with_name(f".{place.name}.new")
    try:
        kind.write(step, name, fresh)
        exchange(fresh, place)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return path


def _saved(folder: str) -> FittedShip:
    spec = parse_spec(folder)
    if spec.path is None or spec.class_name is not None:
        raise InputError(
            f"'{folder}' is not a saved model; give a folder that holds model.json "
            "(cells/<dataset>/<model>/fold0-seed0/model)."
        )
    model = make_predictor(spec)
    if not isinstance(model, FittedShip):
        raise InputError(
            f"the saved model {folder} is '{getattr(model, 'name', type(model).__name__)}', which is not physics alone "
            "and cannot be exported. Accepted: physics, calibrated, and either with effects, such as physics+current."
        )
    return model


def _title(model: FittedShip) -> str:
    """Name of a model: the ship's, the model's and those of its effects."""
    effects = [] if model.extension is None else [term.name for term in model.extension.terms]
    return "_".join([model.ship.name, model.name, *effects])


def _named_after(out: Path, kind: Format, name: str) -> str:
    """Name of the function or model in the file `out`; MATLAB calls a function by the name of its file.

    Raises:
        InputError: the file's name has another end, or no function can have it.
    """
    if kind.suffix and out.suffix != kind.suffix:
        raise InputError(
            f"{option('--out', 'out=')} {out} ends in '{out.suffix}'; accepted: a file name that ends in "
            f"{kind.suffix}, such as {name}{kind.suffix}."
        )
    if kind.suffix != ".m":
        return name
    legal = identifier(out.stem)
    if legal != out.stem:
        raise InputError(
            f"{option('--out', 'out=')} {out}: MATLAB calls a function by its file's name, and '{out.stem}' cannot be "
            f"one. Accepted: letters, digits and underscores, such as {legal}.m."
        )
    return legal


def _check_target(path: Path, model: Path, kind: Format, force: bool) -> None:
    """Refuse to write over what is there, unless asked to, or into the model's own folder.

    Raises:
        InputError: it is there already, is of another kind, or lies in the folder of the model.
    """
    place, replacing = f"another {option('--out', 'out=')}", option("--force", "force=True")
    if path.resolve().is_relative_to(model.resolve()):
        raise InputError(f"{path} lies in the folder of the model; it would be damaged. Give {place}.")
    if not path.exists():
        return
    if path.is_dir() == bool(kind.suffix) or not (path.is_dir() or path.is_file()):
        raise InputError(f"{path} is there already and is no {'file' if kind.suffix else 'folder'}. Give {place}.")
    if path.is_dir() and (others := sorted({p.name for p in path.iterdir()} - c_code.FILES)):
        raise InputError(f"folder {path} holds more than an exported model ({', '.join(others[:4])}). Give {place}.")
    if not force and not (path.is_dir() and not any(path.iterdir())):
        raise InputError(f"{path} is there already. Give {place}, or {replacing} to replace it.")
