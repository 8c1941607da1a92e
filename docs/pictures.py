"""Draws the pictures of the README, light and dark, from the folder that `shipbench demo` writes: `python
docs/pictures.py demo`."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from shipbench.bench.submissions import read_results
from shipbench.data.base import load_dataset

STYLES = {
    "light": {"text": "#1f2328", "grid": "#d0d7de", "truth": "#1f2328", "models": ("#8c959f", "#d95f02", "#0969da")},
    "dark": {"text": "#e6edf3", "grid": "#30363d", "truth": "#e6edf3", "models": ("#8b949e", "#f0883e", "#58a6ff")},
}
"""Colours of text, grid, the measured track and the three models."""


def tracks_and_errors(folder: Path, style: dict[str, Any]) -> Figure:
    """One measured track with three predicted ones, and the growth of the position error with its quartiles over
    runs."""
    models = list(dict.fromkeys(cell.parent.name for cell in sorted((folder / "cells").glob("*/*/*"))))
    order = sorted(models, key=lambda name: (name != "hold", len(name)))
    predicted = {name: _predictions(folder, name) for name in order}
    truth = _truth(folder)
    errors = {
        name: np.array([np.hypot(*(S - truth[run])[:, :2].T) for run, S in found.items()])
        for name, found in predicted.items()
    }
    run = max(truth, key=lambda key: float(errors_of(predicted["physics"][key], truth[key])[-1]))
    figure = Figure(figsize=(8.6, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(truth[run][:, 1], truth[run][:, 0], color=style["truth"], linewidth=2.5, label="measured")
    time = load_dataset("demo").dt * np.arange(1, len(truth[run]) + 1)
    for name, colour in zip(order, style["models"], strict=True):
        left.plot(predicted[name][run][:, 1], predicted[name][run][:, 0], color=colour, linewidth=1.8, label=name)
        low, middle, high = np.quantile(errors[name], [0.25, 0.5, 0.75], axis=0)
        right.plot(time, middle, color=colour, linewidth=1.8, label=name)
        right.fill_between(time, low, high, color=colour, alpha=0.2, linewidth=0)
    title = f"60 s predicted from the orders ({run.split('@')[0]})"
    left.set(xlabel="east [m]", ylabel="north [m]", title=title, aspect="equal", adjustable="datalim")
    right.set(
        xlabel="time predicted [s]", ylabel="position error [m]", title="median and quartiles of 12 held-out runs"
    )
    left.legend(frameon=False)
    return figure


def verdict(folder: Path, style: dict[str, Any]) -> Figure:
    """The evidence of the candidates, and the error of each model on held-out runs."""
    found = json.loads((folder / "diagnosis" / "diagnosis.json").read_text())
    named = [cause["effect"] for cause in found["causes"]]
    scores = {cause["effect"]: cause["score"] for cause in found["causes"]}
    scores |= {
        c["effect"]: c["score"] for c in found["candidates"] if c["effect"] not in scores and c["score"] is not None
    }
    best = sorted(scores, key=lambda name: -scores[name])[:6][::-1]
    rows = read_results([folder]).rows
    error = rows.groupby("model").ed.mean()
    order = sorted(error.index, key=lambda name: (name != "hold", len(name)))
    figure = Figure(figsize=(8.6, 2.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    colours = [style["models"][2] if name in named else style["models"][0] for name in best]
    left.barh([name.replace("_", " ") for name in best], [max(scores[name], 0.0) for name in best], color=colours)
    left.set(xlabel="evidence (twice the log Bayes factor)", title="which cause explains the runs")
    right.barh(order[::-1], [error[name] for name in order[::-1]], color=style["models"][::-1])
    right.set(xlabel="position error on held-out runs [m]", title="what naming it is worth")
    return figure


def errors_of(S: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Position error (K,) [m] of states S (K, 10)."""
    return np.hypot(S[:, 0] - truth[:, 0], S[:, 1] - truth[:, 1])


def _truth(folder: Path) -> dict[str, np.ndarray]:
    """True states (K, 10) by run."""
    return _by_run(folder, {path.stem: path for path in folder.glob("truth/*/*.npz")}, "truth")


def _predictions(folder: Path, model: str) -> dict[str, np.ndarray]:
    """Predicted states (K, 10) by run, each from the fold that did not see it."""
    return _by_run(
        folder, {p.parent.name.split("-")[0]: p for p in folder.glob(f"cells/*/{model}/*/predictions.npz")}, "S"
    )


def _by_run(folder: Path, files: dict[str, Path], key: str) -> dict[str, np.ndarray]:
    found = {}
    for fold, path in sorted(files.items()):
        (truth,) = folder.glob(f"truth/*/{fold}.npz")
        found |= dict(zip((str(name) for name in np.load(truth)["ids"]), np.load(path)[key], strict=True))
    return found


def draw(folder: Path, out: Path) -> list[Path]:
    """Write every picture in both styles; returns the files."""
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for name, style in STYLES.items():
        with mpl.rc_context({
            "text.color": style["text"], "axes.labelcolor": style["text"], "axes.edgecolor": style["grid"],
            "axes.titlesize": 10,
            "xtick.color": style["text"], "ytick.color": style["text"], "axes.grid": True, "grid.color": style["grid"],
            "font.size": 9,
            "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True,
        }):  # fmt: skip
            for stem, picture in (("tracks", tracks_and_errors), ("verdict", verdict)):
                path = out / f"{stem}-{name}.png"
                picture(folder, style).savefig(path, dpi=140, transparent=True)
                written.append(path)
    return written


def photograph(page: Path, out: Path) -> list[Path]:
    """The top of an HTML page in both styles, taken by Chromium; nothing where there is none."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        return []
    written = []
    for style, preferred in (("light", 1), ("dark", 0)):
        path = out / f"page-{style}.png"
        with tempfile.TemporaryDirectory() as profile:
            options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={profile}"]
            options += [
                f"--blink-settings=preferredColorScheme={preferred}",
                "--window-size=1200,900",
                f"--screenshot={path}",
            ]
            subprocess.run([chromium, *options, page.resolve().as_uri()], check=True, capture_output=True, timeout=60)
        written.append(path)
    return written


if __name__ == "__main__":
    results, images = Path(sys.argv[1]), Path(__file__).parent / "img"
    for path in [*draw(results, images), *photograph(results / "report.html", images)]:
        print(path)
