"""Results and data whose names, kinds and models are hostile, the pages made of them, and what such a page holds."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from toy_ship import TOY_SHIP, sail

from shipbench.bench.runner import run_tasks
from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.records import Dataset, Run
from shipbench.reports.dataset.card import make_card
from shipbench.reports.dataset.card_page import write_card
from shipbench.reports.study.page import write_report

HOSTILE = "<img src=x onerror=alert(1)>&\"'</script><script>alert(2)</script>"
MODELS = """
import numpy as np
class Still:
    def fit(self, train, valid=None, *, seed=0): return self
    def predict(self, s0, U, history=None): return np.repeat(s0[:, None], U.shape[1], axis=1)
    def describe(self): return "still\\n  k = 2.5 1/s [1, 3] some <b>gain</b>"
class Fails(Still):
    def predict(self, s0, U, history=None): raise ValueError("</script><script>alert(3)</script> no")
class Blows(Still):
    def predict(self, s0, U, history=None):
        S = np.repeat(s0[:, None], U.shape[1], axis=1)
        S[0, 5:] = np.inf
        return S
"""


def run_study(folder: Path) -> Path:
    """Results of four models, one of which fails and one diverges, on runs with hostile names."""
    runs = []
    for i in range(9):
        S, C = sail(30, i)
        S[:, 6], C[:, 0], C[:, 2] = (-40.0, -40.0, 5e3) if i == 4 else (90.0, 90.0, 0.0)
        runs.append(Run(f"r{i} {HOSTILE}", np.arange(31.0), S, C, meta={"manoeuvre": "turn" if i % 2 else HOSTILE}))
    (folder / "m.py").write_text(MODELS)
    models = ["hold", f"{folder}/m.py:Still", f"{folder}/m.py:Fails", f"{folder}/m.py:Blows"]
    patch = pytest.MonkeyPatch()
    patch.setattr(
        "shipbench.bench.runner.load_dataset", lambda name: Dataset("toy", TOY_SHIP, 1.0, tuple(runs), source=HOSTILE)
    )
    run_tasks(
        [make_task({"dataset": "toy", "models": models, "horizon_s": 30, "folds": 3})],
        folder / "out",
        command=f"shipbench run {HOSTILE}",
    )
    patch.undo()
    return folder / "out"


class Elements(HTMLParser):
    """Start tags with their attributes, and the data of scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def page_of(study, tmp_path, **options):
    return write_report(read_results([study]), tmp_path / "page.html", f"shipbench report {HOSTILE}", **options)


def card_of(folder):
    """The page of runs whose names and kinds of manoeuvre are hostile."""
    runs = []
    for i in range(30):
        S, C = sail(30, i)
        runs.append(Run(f"r{i} {HOSTILE}", np.arange(31.0), S, C, meta={"manoeuvre": HOSTILE if i == 29 else "turn"}))
    data = Dataset("toy", TOY_SHIP, 1.0, tuple(runs), source=HOSTILE)
    return write_card(make_card(data), data, folder, f"shipbench data describe {HOSTILE}")[1]


def drawings(text):
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)[1])
