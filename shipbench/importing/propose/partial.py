"""Partial mapping: entries that a person knows already, kept by the draft."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...toml_files import read_toml
from ..entries import check_channel
from ..mapping import validated

_REST = {"time": {"rate": 1.0}, "channels": {"psi": {"column": "any", "unit": "rad"}}}


def read_partial(path: Path) -> dict[str, Any]:
    """Read the entries of a mapping of which any part may be missing.

    Raises:
        InputError: not TOML; an unknown key, channel, unit or sign, or a value of another type.
    """
    data = read_toml(path)
    whole: dict[str, Any] = {"name": "any", "dt": 1.0} | data
    sources = data.get("sources")
    if isinstance(sources, dict) and sources:
        whole["sources"] = {
            name: _REST | source if isinstance(source, dict) else source for name, source in sources.items()
        }
    elif "sources" not in data:
        whole = _REST | whole
    mapping = validated(whole, path)
    for source in mapping.sources.values():
        for name, channel in source.channels.items():
            check_channel(name, channel, path)
    return data
