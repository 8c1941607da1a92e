"""Plan of a simulation: all that a worker process has to know of an FMU, and the names of its answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of one FMU, extracted in `folder`.

    Args:
        folder: where it is extracted.
        version: 2 or 3, of FMI.
        kind: "co-simulation" or "model-exchange".
        identifier, token: of the library.
        set_refs: value references that are set before the initialisation: start values, constants, open parameters.
        input_refs, output_refs: value references.
        dt: sample time [s].
        substeps: steps in one sample time.
        states, events: counts of continuous states and event indicators.
        completes: whether model exchange needs `CompletedIntegratorStep`.
    """

    folder: str
    version: int
    kind: str
    identifier: str
    token: str
    set_refs: np.ndarray
    input_refs: np.ndarray
    output_refs: np.ndarray
    dt: float
    substeps: int
    states: int
    events: int
    completes: bool


@dataclass(frozen=True, eq=False)
class Answer:
    """Result of one run: outputs (K + 1, outputs), NaN after a failure, and the reason of the failure."""

    place: int
    outputs: np.ndarray
    reason: str = ""
