"""Facts on a model before it is fitted: whose code it is, its files, and how it is fitted."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..effects.base import EFFECTS
from ..errors import InputError, ShipbenchError
from ..predictors._saved import Origin, read_meta
from ..predictors._user_file import code_of
from ..predictors.base import PREDICTORS, learns, make_predictor
from ..registry import package_digest, reason
from ..replay.reading import files_of
from ..specs import Spec
from .isolate import call_isolated
from .provenance import source_digest

_FOREIGN_CODE = frozenset({"fmu"})
"""Predictors that run code of others from a file."""


@dataclass(frozen=True)
class ModelFacts:
    """Facts on the model of a spec.

    Args:
        foreign: it runs code that is not shipbench's (a model file, a plug-in), which is loaded in processes of its own
            only.
        seeded: it draws random numbers.
        together: its class fits several folds at once.
        files: content by relative name of the user's code, or of the saved folder.
        plugins: versions of the model's and its effects' plug-ins ("" for shipbench's own).
        code: digests of the packages that it takes, which a worker compares with its own (`package_digest`).
        origin: training data of a saved model.
        learns: its fit learns from the runs.
        warm: it has a warm start (see `Predictor`).
    """

    foreign: bool
    seeded: bool = True
    together: bool = False
    files: dict[str, bytes] = field(default_factory=dict)
    plugins: list[str] = field(default_factory=list)
    code: dict[str, str] = field(default_factory=dict)
    origin: Origin | None = None
    learns: bool = True
    warm: bool = False


class _Made(NamedTuple):
    """Facts that only the model itself tells, as those of `ModelFacts`."""

    seeded: bool
    together: bool
    files: dict[str, bytes]
    origin: Origin | None
    learns: bool
    warm: bool


def facts_of(spec: Spec) -> ModelFacts:
    """Facts on a model. It is made once, so that an unknown name or parameter is reported before anything is loaded or
    fitted.

    Raises:
        InputError: the model cannot be made.
    """
    kind = _kind(spec)
    taken = [(EFFECTS, effect.name) for effect in spec.effects] + ([(PREDICTORS, kind)] if kind in PREDICTORS else [])
    packages = sorted({package for registry, name in taken if (package := registry.package(name))})
    foreign = bool(packages) or spec.class_name is not None or kind in _FOREIGN_CODE
    if foreign:
        made, unanswered = call_isolated(_made_alone, (spec,))
        if unanswered:
            raise InputError(f"model '{spec.text}' cannot be made: {unanswered}. Correct its file.")
    else:
        made = _made(spec)
    if isinstance(made, ShipbenchError):
        raise made
    plugins = [registry.digest(name) for registry, name in taken]
    code = {"shipbench": source_digest(), **{package: package_digest(package) for package in packages}}
    return ModelFacts(
        foreign, made.seeded, made.together, made.files, plugins, code, made.origin, made.learns, made.warm
    )


def _kind(spec: Spec) -> str:
    """Name of the registered predictor behind a spec, "" for a model file and for a model in memory."""
    if spec.class_name is not None or spec.given is not None:
        return ""
    if spec.reader:
        return spec.reader
    if spec.path is None:
        return spec.name.partition(":")[0]
    return str(read_meta(spec.path)["predictor"])


def _made_alone(spec: Spec) -> _Made | ShipbenchError:
    """Result of `_made` in a process of its own, without Ctrl-C: any exception is the model's."""
    try:
        return _made(spec)
    except BaseException as error:
        return InputError(f"model '{spec.text}' cannot be made: {reason(error)}. Correct its file.")


def _made(spec: Spec) -> _Made | ShipbenchError:
    """Facts, or the reason why the model cannot be made."""
    try:
        model: Any = make_predictor(spec)
        return _Made(
            getattr(model, "seeded", True) is not False,
            hasattr(type(model), "fit_group"),
            _files(spec),
            getattr(model, "origin", None),
            learns(spec, model),
            hasattr(model, "warm_start"),
        )
    except ShipbenchError as error:
        return error
    except (Exception, SystemExit) as error:  # a user's own module is imported here
        return InputError(f"model '{spec.text}' cannot be made: {reason(error)}. Correct its file.")


def _files(spec: Spec) -> dict[str, bytes]:
    if spec.path is None:
        return {}
    if spec.reader == "predictions":
        return {path.as_posix(): path.read_bytes() for path in files_of(spec.path, str(spec.params.get("mapping", "")))}
    if spec.class_name is not None:
        return code_of(spec.path)
    if spec.path.is_file():
        beside = (spec.path, spec.path.with_name(f"{spec.path.name}.toml"))  # an FMU's mapping
        return {p.name: p.read_bytes() for p in beside if p.is_file()}
    return {
        p.relative_to(spec.path.parent).as_posix(): p.read_bytes() for p in sorted(spec.path.rglob("*")) if p.is_file()
    }
