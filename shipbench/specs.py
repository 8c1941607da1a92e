"""Specs: one string names a part and sets its parameters, `mlp[hidden=64,seed=3]`, `physics+current[speed=0.3,to=1.0]`,
`path.py:Class`."""

from __future__ import annotations

import inspect
import json
import os
import re
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

from .errors import InputError
from .names import brief

_PARAMS = r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]"
"""Pattern of a bracket, which may hold lists: [hidden_layer_sizes=[20,20],max_iter=30]."""
_ITEM = re.compile(r"(?:[^,\[\]()]|\[[^\[\]]*\]|\([^()]*\))+")
"""Pattern of the text between two commas of a bracket; a list in brackets or parentheses holds commas of its own."""
_LONGEST_TOLD = 200
"""Most characters of the values in the label of a model in memory."""
_TAIL = rf"(?P<tail>(\+[^\[\]+]+({_PARAMS})?)*)"
_FILE = re.compile(rf"(?P<base>[^\[\]]+\.py:\w+)(?P<params>{_PARAMS})?{_TAIL}")
READERS = {"predictions": re.compile(r"predictions:(.+)"), "fmu": re.compile(r"(.+\.fmu)")}
"""Predictors that are made of a file or folder, and the form of their specs."""
_NAME = re.compile(rf"(?P<base>[^\[\]+]+)(?P<params>{_PARAMS})?{_TAIL}")


@dataclass(frozen=True)
class EffectSpec:
    """Effect that a spec adds, `current[speed=0.3,to=1.0]`, and the values that it sets."""

    name: str
    params: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Spec:
    """Model spec in its parts: `physics+current[..]` -> name "physics", effects (EffectSpec("current", {..}),).

    given: the class, object or function of a model in memory, which `name` and `text` only label.
    reader: name of the predictor that is made of the file or folder `path`; "" for a saved model and for a class.
    matched: content of `path` after it was read and matched to the runs of a data set, where the reader needs them.
    """

    text: str
    name: str
    params: dict[str, Any]
    effects: tuple[EffectSpec, ...] = ()
    path: Path | None = None
    class_name: str | None = None
    given: Any = None
    reader: str = ""
    matched: Any = field(default=None, compare=False, repr=False)

    def __repr__(self) -> str:
        return brief(f"<Spec {self.text}>")

    @property
    def saved(self) -> bool:
        """Whether it is the folder of a saved model, which comes fitted."""
        return self.path is not None and self.class_name is None and not self.reader

    @property
    def seeds(self) -> list[int] | None:
        """Seed that the spec itself fixes, if any."""
        return [self.params["seed"]] if "seed" in self.params else None


def _value(text: str) -> Any:
    """Value as a number, true, false, null, a list such as [20,20], (20,20) or [Xuu,Nrr], or else the text itself."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        if text[:1] + text[-1:] in ("()", "[]"):
            return [_value(item.strip()) for item in text[1:-1].split(",") if item.strip()]
        return text


def _params(text: str, bracket: str | None) -> dict[str, Any]:
    """Parameters in a bracket, `[key=value,key=value]`."""
    params: dict[str, Any] = {}
    for item in _ITEM.findall((bracket or "[]")[1:-1]):
        key, sep, value = item.partition("=")
        if not sep or not key.strip():
            raise InputError(f"model spec '{text}': parameter '{item}' has no value; write name[key=value,key=value].")
        params[key.strip()] = _value(value.strip())
    seed = params.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**32:
        raise InputError(f"model spec '{text}': seed = {seed}; accepted: a whole number from 0 to {2**32 - 1}.")
    return params


def parse_spec(text: str) -> Spec:
    """Parse a model spec; a folder that holds a saved model is taken as it is, whatever its name.

    Raises:
        InputError: the text has none of the accepted forms.
    """
    wanted = text.strip()
    if os.path.isfile(os.path.join(wanted, "model.json")):
        return Spec(text, wanted, {}, path=Path(wanted))
    match = _FILE.fullmatch(wanted) or _NAME.fullmatch(wanted)
    if match is None:
        raise InputError(
            f"model spec '{text}' cannot be read; accepted: name, name[key=value,...], physics+effect, "
            "physics+effect[key=value,...], path.py:Class, path.py:simulate, predictions:FOLDER, path.fmu, "
            "a saved folder."
        )
    base, params = match["base"], _params(text, match["params"])
    for reader, named in READERS.items():
        if (found := named.fullmatch(base.strip())) is not None:
            return Spec(text, base.strip(), params, _effects(text, match["tail"]), Path(found[1]), reader=reader)
    effects = _effects(text, match["tail"])
    if match.re is _FILE:
        file, _, class_name = base.rpartition(":")
        return Spec(text, class_name, params, effects, path=Path(file), class_name=class_name)
    if os.path.isfile(os.path.join(base, "model.json")):
        return Spec(text, base, params, effects, path=Path(base))
    return Spec(text, base.strip(), params, effects)


def _effects(text: str, tail: str) -> tuple[EffectSpec, ...]:
    added = re.findall(rf"\+([^\[\]+]+)({_PARAMS})?", tail)
    return tuple(EffectSpec(name.strip(), _params(text, bracket or None)) for name, bracket in added)


def spec_of(model: Any, label: str = "") -> Spec:
    """Spec of a model: text as `parse_spec` takes it, a path, a Spec, or a class or object in memory with `fit` and
    `predict`.

    Args:
        label: name of a model in memory; default its class with the parameters that differ from their defaults,
            `MyNet[hidden=64]`.

    Raises:
        InputError: it is none of these.
    """
    if isinstance(model, Spec):
        return model
    if isinstance(model, str | os.PathLike):
        return parse_spec(os.fspath(model))
    lacking = [method for method in ("fit", "predict") if not callable(getattr(model, method, None))]
    simulates = callable(getattr(model, "simulate", None)) or (callable(model) and not isinstance(model, type))
    if lacking and ("fit" not in lacking or not simulates):
        raise InputError(
            f"the model {_class_name(model)} has no method {' and no '.join(lacking)}. Accepted: a spec such as "
            "'physics', a class or object with "
            "fit(train, valid=None, *, seed=0) and predict(s0, U, history=None), or a function simulate(s0, U, dt)."
        )
    text = label or (model.__name__ if inspect.isroutine(model) else _label(model))
    return Spec(text, text, {}, given=model)


def _class_name(model: Any) -> str:
    return (model if isinstance(model, type) else type(model)).__name__


def _label(model: Any) -> str:
    """Class of a model, and those fields of a dataclass that differ from their defaults."""
    name = _class_name(model)
    if isinstance(model, type) or not is_dataclass(model):
        return name
    changed = [(f.name, getattr(model, f.name, f.default)) for f in fields(model) if f.init and f.repr]
    defaults = {f.name: f.default for f in fields(model)}
    told = [
        f"{key}={value}"
        for key, value in changed
        if isinstance(value, bool | int | float | str) and value != defaults[key]
    ]
    return name + (f"[{','.join(told)}]" if told and len(",".join(told)) <= _LONGEST_TOLD else "")
