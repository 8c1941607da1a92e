"""A diagnosis and its rollouts, made without fitting anything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipbench.diagnosis.result import Candidate, Cause, Diagnosis, Estimate, Gain, Trace, Wrong

GAIN = Gain("ED", 21.3, 9.8, 0.54, (0.4, 0.66), "24/24")
CAUSE = Cause(
    "current", 1, 120.0, 0.001, {"speed": Estimate(0.31, "m/s", (0.28, 0.34)), "to": Estimate(2.5, "rad", (2.4, 2.6))},
    ("wind",),
    "reciprocal courses", GAIN, "", "24 of 24 runs", {"sway": 38123.0, "yaw": 1.2e6},
)  # fmt: skip
CANDIDATES = (
    Candidate(
        "current",
        120.0,
        0.001,
        "named",
        {"north": 0.2},
        {"north": 0.05, "east": float("nan")},
        {"speed": "m/s", "to": "rad"},
        "environment",
    ),
    Candidate(
        "heading_bias",
        float("nan"),
        float("nan"),
        "score below the threshold",
        {},
        {"bias": 0.002},
        {"bias": "rad"},
        "sensor",
    ),
)


def make_trace(runs: int = 12, samples: int = 61, seed: int = 0) -> Trace:
    """Runs on courses all round, with white residuals, no missing force, and a sway error that grows with time."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(samples))
    measured = np.zeros((runs, samples, 6))
    measured[..., 2] = np.linspace(0.0, 2.0 * np.pi, runs, endpoint=False)[:, None] + 0.3 * np.sin(t / 20.0)
    measured[..., 3] = rng.uniform(2.0, 6.0, (runs, 1)) + 0.2 * np.sin(t / 9.0)
    measured[..., 4], measured[..., 5] = 0.3 * np.sin(t / 7.0 + rng.uniform(0, 6, (runs, 1))), 0.01 * np.cos(t / 11.0)
    measured[..., 0] = np.cumsum(measured[..., 3], axis=1)
    before = measured.copy()
    before[..., 4] += 0.01 * t * rng.choice([-1.0, 1.0], (runs, 1))
    inputs = np.zeros((runs, samples, 4))
    inputs[..., 0], inputs[..., 1] = 50.0, 0.2 * np.sin(t / 7.0 + rng.uniform(0, 6, (runs, 1)))
    knots = t[::5]
    force = 1e-4 * rng.standard_normal((runs, len(knots), 3))
    white = rng.standard_normal((runs, samples, 6))
    names = tuple(f"r{i}" for i in range(runs))
    return Trace(
        np.arange(runs),
        names,
        np.zeros(runs),
        t,
        measured,
        before,
        before,
        inputs,
        knots,
        force,
        0.1 + 0 * force,
        force,
        white,
    )


def make_diagnosis(verdict: str = "found", name: str = "trial") -> Diagnosis:
    found = verdict == "found"
    unknown = (
        {"axis": "yaw", "variable": "heading", "form": "cos(3 psi + phase)", "score": 44.0, "share": 0.5}
        if verdict == "unknown"
        else None
    )
    return Diagnosis(
        dataset=name, verdict=verdict, causes=(CAUSE,) if found else (), candidates=CANDIDATES,
        what_is_wrong=(Wrong("sway", 0.6, "heading", "worst at 90 to 135 deg"),),
        unexplained_after={"force_sd": {"surge": 0.001}},
        extended_model="calibrated+current" if found else "physics", fingerprint="abc", seconds=12.0,
        warnings=("few runs",),
        gain=GAIN if found else None, unknown=unknown,
        gain_per_run=(("a", 20.0, 9.0), ("b", 22.0, 10.6)) if found else (), trace=make_trace(4),
    )  # fmt: skip


def extended(d: Diagnosis) -> Diagnosis:
    """With rollouts of an extended model that is right."""
    return replace(d, trace=replace(d.trace, after=d.trace.measured + 0.01))
