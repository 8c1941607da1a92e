"""Specs: one string names a part and sets its parameters, `mlp[hidden=64,seed=3]`, `physics+current`, `path.py:Class` (contract, section 2)."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import InputError


@dataclass(frozen=True)
class Spec:
    """A model spec taken apart: `physics+current[..]` -> name "physics", effects ("current",)."""

    text: str
    name: str
    params: dict[str, Any]
    effects: tuple[str, ...] = ()
    path: Path | None = None
    class_name: str | None = None

    @property
    def seeds(self) -> list[int] | None:
        """The seed that the spec itself fixes, if any."""
        return [int(self.params["seed"])] if "seed" in self.params else None


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def parse_spec(text: str) -> Spec:
    """Take a model spec apart (contract, section 2).

    Raises:
        InputError: the text has none of the accepted forms.
    """
    match = re.fullmatch(r"(?P<base>[^\[\]]+?)(\[(?P<params>[^\[\]]*)\])?(?P<tail>(\+[\w.]+)*)", text.strip())
    if match is None:
        raise InputError(f"model spec '{text}' cannot be read; accepted: name, name[key=value,...], physics+effect, path.py:Class, a saved folder.")
    params: dict[str, Any] = {}
    for item in filter(None, (match["params"] or "").split(",")):
        key, sep, value = item.partition("=")
        if not sep or not key.strip():
            raise InputError(f"model spec '{text}': parameter '{item}' has no value; write name[key=value,key=value].")
        params[key.strip()] = _value(value.strip())
    base = match["base"]
    file, colon, class_name = base.rpartition(":")
    if colon and file.endswith(".py"):
        return Spec(text, class_name, params, path=Path(file), class_name=class_name)
    if Path(base, "model.json").is_file():
        return Spec(text, base, params, path=Path(base))
    name, *effects = (base + (match["tail"] or "")).split("+")
    return Spec(text, name, params, tuple(effects))
