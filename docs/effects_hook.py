"""Writes the catalogue of causes into effects.md when the site is built: what each is, and a picture of what it does to
two manoeuvres."""

from __future__ import annotations

import inspect
import io
from collections.abc import Iterator
from typing import Any

_DT, _STEPS, _RPM, _SPEED = 2.0, 120, 93.0, 3.7
"""Sample time [s], samples, shaft speed [rpm] and speed [m/s] at which the 130 m container ship starts."""


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Called by mkdocs for every page."""
    if page.file.src_path != "effects.md":
        return markdown
    return markdown.replace("<!-- effects -->", "\n".join(_sections()))


def _sections() -> Iterator[str]:
    from shipbench.effects.base import EFFECTS, FAMILIES

    effects = [EFFECTS.get(name) for name in EFFECTS.names()]
    for family in FAMILIES:
        yield f"## {family.capitalize()}\n"
        for effect in (e for e in effects if e.family == family):
            yield f"### `{effect.name}`\n"
            yield f"{_prose(inspect.getmodule(type(effect)))}\n"
            if effect.parameters:
                yield "| parameter | unit | typical size | accepted |\n|---|---|---:|---|"
                for p in effect.parameters:
                    yield f"| `{p.name}` | {p.unit} | {p.typical:.3g} | {p.low:.3g} to {p.high:.3g} |"
                yield ""
            yield f"To separate it from its look-alikes: {effect.separate}.\n"
            yield f"Source: {effect.source}.\n"
            if (picture := _picture(effect)) is not None:
                yield f"{picture}\n"


def _prose(module: Any) -> str:
    return " ".join((inspect.getdoc(module) or "").split())


def _commands(effect: Any) -> tuple[Any, Any]:
    """Start states (2, 10) and commands (2, steps, 4): a turn, and what shows the family best: a zig-zag, a stop, or a
    push of the thrusters."""
    import numpy as np

    t = np.arange(_STEPS) * _DT
    s0, U = np.zeros((2, 10)), np.zeros((2, _STEPS, 4))
    s0[:, 3], s0[:, 6], U[:, :, 0] = _SPEED, _RPM, _RPM
    U[0, t >= 10.0, 1] = np.deg2rad(20.0)
    if effect.family == "thruster":
        s0[:, 3], s0[:, 6], U[:, :, 0], U[:, :, 1] = 1.5, 38.0, 38.0, 0.0
        U[0, t >= 10.0, 2], U[1, t >= 10.0, 2], U[1, t >= 10.0, 3] = 4e4, 4e4, 4e4
    elif effect.family == "propulsion":
        U[1, t >= 10.0, 0] = -90.0
    else:
        U[1, :, 1] = np.deg2rad(15.0) * np.where(t < 10.0, 0.0, np.where((t - 10.0) % 120.0 < 60.0, 1.0, -1.0))
    return s0, U


def _picture(effect: Any) -> str | None:
    """An inline SVG of the tracks with and without the effect at its typical size; None where nothing can be drawn."""
    import matplotlib as mpl
    import numpy as np
    from matplotlib.figure import Figure

    from shipbench.physics.mmg import load_mmg_ship
    from shipbench.simulate.hidden import Hidden, record, sail

    if not effect.parameters or effect.name == "unit_or_sign_error":
        return None
    ship = load_mmg_ship("container130")
    s0, U = _commands(effect)
    wind = (
        np.tile([8.0, np.deg2rad(60.0)], (2, _STEPS, 1)) if effect.family == "environment" and effect.channels else None
    )
    q = tuple(p.typical for p in effect.sized(ship.L))
    hidden = [Hidden(effect, q)]
    rng = np.random.default_rng(0)
    plain = sail(ship, s0, U, _DT, wind=wind, max_step=_DT)
    true = plain if effect.enters == "sensor" else sail(ship, s0, U, _DT, hidden, wind=wind, max_step=_DT)
    changed = record(true, _DT, hidden, np.zeros(10), rng)
    if np.array_equal(plain, changed):
        return None
    names = {"thruster": ("bow thruster", "both thrusters"), "propulsion": ("turn, 20°", "stop")}.get(
        effect.family, ("turn, 20°", "zig-zag, 15°")
    )
    channel, label, scale = (
        (2, "heading [deg]", np.rad2deg(1.0)) if effect.family != "propulsion" else (3, "surge speed [m/s]", 1.0)
    )
    with mpl.rc_context({"svg.fonttype": "none", "font.size": 9, "svg.hashsalt": "shipbench"}):
        figure = Figure(figsize=(7.2, 2.5), layout="constrained")
        for axes, run, name in zip(figure.subplots(1, 3)[:2], range(2), names, strict=True):
            axes.plot(plain[run, :, 1], plain[run, :, 0], color="#888888", label="without")
            axes.plot(changed[run, :, 1], changed[run, :, 0], color="#d95f02", label="with")
            axes.set(title=name, xlabel="east [m]", ylabel="north [m]", aspect="equal", adjustable="datalim")
        axes = figure.axes[2]
        time = np.arange(_STEPS + 1) * _DT
        axes.plot(time, scale * plain[1, :, channel], color="#888888", label="without")
        axes.plot(time, scale * changed[1, :, channel], color="#d95f02", label="with")
        axes.set(title=names[1], xlabel="time [s]", ylabel=label)
        axes.legend(frameon=False)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None}, transparent=True)
    svg = out.getvalue()
    return (
        svg[svg.index("<svg") :]
        .replace("<svg ", f'<svg role="img" aria-label="{effect.name}: tracks with and without it" class="effect" ', 1)
        .replace("\n", " ")
    )
