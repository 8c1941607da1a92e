"""A ship whose motion is a formula, and the files that its trial leaves behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import cumulative_simpson

SHIP = 'name = "trial"\nL = 50.0\nB = 8.0\nT = 3.0\nmass = 9e5\n'
COLUMNS = {
    "x": ("north", "m"), "y": ("east", "m"), "psi": ("HDG", "deg"), "u": ("surge", "kn"), "v": ("sway", "m/s"),
    "r": ("ROT", "deg/min"),
    "n": ("rpm", "rpm"), "delta": ("rudder", "deg"), "delta_c": ("rudder order", "deg"),
}  # fmt: skip


def motion(t: np.ndarray) -> dict[str, np.ndarray]:
    """States and commands at times t [s] in SI: the ship weaves at about 4 m/s; its heading crosses 180 degrees."""
    fine = np.arange(0.0, max(float(np.max(t)), 1.0) + 0.1, 0.05)

    def body(s):
        psi = 2.9 + 0.9 * np.sin(s / 25.0)
        return psi, 4.0 + 0.4 * np.sin(s / 30.0), -0.3 * np.cos(s / 25.0), 0.9 / 25.0 * np.cos(s / 25.0)

    psi, u, v, _ = body(fine)
    x = cumulative_simpson(u * np.cos(psi) - v * np.sin(psi), x=fine, initial=0.0)
    y = cumulative_simpson(u * np.sin(psi) + v * np.cos(psi), x=fine, initial=0.0)
    psi, u, v, r = body(t)
    delta_c = np.where((t // 20.0) % 2 == 0, 0.2, -0.2)
    from scipy.interpolate import CubicSpline

    return {
        "x": CubicSpline(fine, x)(t), "y": CubicSpline(fine, y)(t), "psi": psi, "u": u, "v": v, "r": r,
        "n": np.full_like(t, 110.0), "delta": 0.2 * np.sin(t / 20.0), "delta_c": delta_c,
    }  # fmt: skip


def logged(t: np.ndarray) -> pd.DataFrame:
    """The same as a bridge would log it: other names and units, heading 0 to 360."""
    s = motion(t)
    return pd.DataFrame({
        "time": t, "north": s["x"], "east": s["y"], "HDG": np.rad2deg(s["psi"]) % 360.0, "surge": s["u"] * 3600 / 1852,
        "sway": s["v"],
        "ROT": np.rad2deg(s["r"]) * 60.0, "rpm": s["n"], "rudder": np.rad2deg(s["delta"]),
        "rudder order": np.rad2deg(s["delta_c"]),
    })  # fmt: skip


def channels(*without: str, **extra: str) -> str:
    """[channels] of a mapping for `logged`, less some, plus some as TOML."""
    lines = [
        f'{ours} = {{ column = "{name}", unit = "{unit}" }}'
        for ours, (name, unit) in COLUMNS.items()
        if ours not in (*without, *extra)
    ]
    return "\n".join(["[channels]", *lines, *(f"{ours} = {entry}" for ours, entry in extra.items())]) + "\n"


def mapping(top: str = "", time: str = 'column = "time"', tables: str = "", body: str | None = None) -> str:
    """The text of a mapping; `top` goes before the first table, `tables` before [channels]."""
    head = 'name = "trial"\n' + ("" if "dt =" in top else "dt = 1.0\n")
    return f"{head}{top}\n[time]\n{time}\n{tables}\n{channels() if body is None else body}"


def write(folder: Path, name: str, content: str | bytes | pd.DataFrame) -> Path:
    """A file in `folder`."""
    path = folder / name
    if isinstance(content, pd.DataFrame):
        content.to_csv(path, index=False)
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_text(content, encoding="utf-8")
    return path
