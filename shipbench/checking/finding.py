"""Findings of a check: the fault, its figures, a picture, and the lines of dataset.toml that correct it."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..names import brief
from ..signals import UNITS

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


def labelled(*channels: str) -> str:
    """Axis label of channels with one unit: "x, y [m]"."""
    return f"{', '.join(channels)} [{UNITS[channels[0].removesuffix('_c')]}]"


@dataclass(frozen=True, eq=False, repr=False)
class Curve:
    """Line or point cloud of a picture: x, y of equal length; style is matplotlib's ("-", ".")."""

    label: str
    x: np.ndarray
    y: np.ndarray
    style: str = "-"


@dataclass(frozen=True, eq=False)
class Picture:
    """Evidence as a picture; axis labels carry units."""

    title: str
    xlabel: str
    ylabel: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Finding:
    """Fault or peculiarity of a data set.

    Args:
        check: name of the check that found it.
        severity: "error" (fits are wrong or the loader refuses it), "warning" (fits suffer), "note" (good to know).
        kind: the fault in a few words, the same for every data set.
        text: the fault, with the figures.
        line: TOML for dataset.toml that corrects it, or "".
        todo: action in place of the line, or in addition.
        channels, runs: those concerned; runs empty: all.
        evidence: figures by name.
    """

    check: str
    severity: Severity
    kind: str
    text: str
    line: str = ""
    todo: str = ""
    channels: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()
    evidence: dict[str, Any] = field(default_factory=dict)
    picture: Picture | None = None

    def __repr__(self) -> str:
        return brief(f"<{self.severity}, {self.kind}: {self.text}>")

    def as_json(self) -> dict[str, Any]:
        """Fields without the picture, with plain numbers."""
        figures = {k: v.item() if hasattr(v, "item") else v for k, v in self.evidence.items()}
        return {
            "check": self.check, "severity": self.severity, "kind": self.kind, "text": self.text, "line": self.line,
            "todo": self.todo,
            "channels": list(self.channels), "runs": list(self.runs), "evidence": figures,
        }  # fmt: skip


def toml_line(data: dict[str, Any]) -> str:
    """TOML in compact form: values first, then tables; numbers to six digits, lists on one line."""
    return "\n".join(_toml(data, ()))


def _toml(table: dict[str, Any], path: tuple[str, ...]) -> list[str]:
    plain = {k: v for k, v in table.items() if not isinstance(v, dict)}
    lines = [f"[{'.'.join(map(_key, path))}]"] if path and plain else []
    lines += [f"{_key(k)} = {json.dumps(_plain(v), ensure_ascii=False)}" for k, v in plain.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            lines += _toml(value, (*path, key))
    return lines


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key, ensure_ascii=False)


def _plain(value: Any) -> Any:
    """Value as JSON and TOML both write it: list, text, whole number or float."""
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    value = value.item() if hasattr(value, "item") else value
    return float(f"{value:.6g}") if isinstance(value, float) else value
