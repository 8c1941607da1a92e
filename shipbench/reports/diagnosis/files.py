"""Diagnosis on disk: diagnosis.json, summary.txt and a self-contained page."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...diagnosis.result import Diagnosis
from ...specs import parse_spec
from ...storage import write_text
from .page import diagnosis_page
from .summary import summary_lines
from .text import in_words


def write_diagnosis(d: Diagnosis, folder: Path) -> list[Path]:
    """Write diagnosis.json, summary.txt and report.html into `folder` (made if missing), each atomically; returns the
    paths. With a corrected simulation also `write_correction`."""
    content = json.dumps(document(d), indent=1, allow_nan=False)
    return [
        write_text(folder / "diagnosis.json", content + "\n"),
        write_text(folder / "summary.txt", "\n".join(summary_lines(d)) + "\n"),
        write_report(d, folder / "report.html"),
        *(write_correction(d, folder) if corrects(d) else [_write_law(d, folder)] if d.correction is not None else []),
    ]


def with_correction(d: Diagnosis, folder: Path) -> Diagnosis:
    """Diagnosis that proposes the corrected simulation which `write_diagnosis` writes into `folder`, if it does."""
    return replace(d, extended_model=f"{folder / _CORRECTED}:corrected") if corrects(d) else d


def corrects(d: Diagnosis) -> bool:
    """Whether a correction of the simulation can be written: it has a file, and the correction reduces its error."""
    if d.correction is None or d.calibration is None or d.stand_in or parse_spec(d.simulation).path is None:
        return False
    after = d.calibration.after if d.gain is None else min(d.calibration.after, d.gain.after)
    return after < d.calibration.before or bool(d.causes)


def write_correction(d: Diagnosis, folder: Path) -> list[Path]:
    """Write corrected.py, a model that corrects the simulation, its fitted physics in `correction/`, and
    force_law.txt with every coefficient; returns the paths."""
    if d.correction is None:
        return []
    d.correction.save(folder / "correction")
    spec = parse_spec(d.simulation)
    place = os.path.relpath(Path(str(spec.path)).absolute(), folder.absolute())
    text = d.simulation.replace(str(spec.path), Path(place).as_posix(), 1)
    found = "; ".join(in_words(c) for c in d.causes) or "nothing beyond the ship's own coefficients"
    return [
        write_text(
            folder / _CORRECTED, _MODULE.format(found=repr(found), spec=repr(text), fingerprint=repr(d.fingerprint))
        ),
        _write_law(d, folder),
    ]


def _write_law(d: Diagnosis, folder: Path) -> Path:
    """Write force_law.txt: coefficients of the physics whose difference to the nearest one corrects the simulation."""
    law = "" if d.correction is None else str(d.correction.physics.describe()).rstrip()
    return write_text(folder / "force_law.txt", f"{_LAW}\n\n{law}\n")


_LAW = (
    "Correction of the simulation: at every step the accelerations by the coefficients and causes below are added,\n"
    "and those of the physics nearest to the simulation (correction/reference.json) are taken off."
)
_CORRECTED = "corrected.py"
_MODULE = '''"""Simulation with a correction, as `shipbench diagnose` found it. Model spec: corrected.py:corrected"""

from pathlib import Path

from shipbench.predictors.physics_model.correction import corrected_simulation

FOUND = {found}
SIMULATION = {spec}
"""Its place is relative to this file."""
FITTED_TO = {fingerprint}
"""Fingerprint of the data set whose runs the correction knows."""
corrected = corrected_simulation(SIMULATION, Path(__file__).parent, FITTED_TO)
"""Function (s0, U, dt, context) -> S, as `simulate`; force_law.txt has its coefficients."""
'''
"""Text of corrected.py; every word from outside is the `repr` of a string."""


def document(d: Diagnosis) -> dict[str, Any]:
    """Content of diagnosis.json: `Diagnosis.document`, and every cause in words."""
    content = d.document()
    for c, cause in zip(d.causes, content["causes"], strict=True):
        cause["in_words"] = in_words(c)
    return content


def write_report(d: Diagnosis, path: Path) -> Path:
    """Write the page alone; returns `path`."""
    return write_text(path, diagnosis_page(d))
