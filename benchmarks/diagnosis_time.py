"""Whole diagnoses, selection and fits repeated on every training part: 24 runs of 120 s within 60 s on two cores, 90
runs within three minutes.

    python benchmarks/diagnosis_time.py [--quick] [--json FILE]

Trials of KCS with nothing hidden, with a current, and with a compass error beside a slow rudder. One run of each,
machine code in the cache folder.
"""

from __future__ import annotations

import time

import measure

from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

LIMITS = {24: 60.0, 90: 180.0}
HIDDEN = {
    "nothing": (),
    "current": (Hidden(EFFECTS.get("current"), (0.25, -0.2)),),
    "heading_bias, rudder_rate_limit": (
        Hidden(EFFECTS.get("heading_bias"), (0.03,)),
        Hidden(EFFECTS.get("rudder_rate_limit"), (0.02,)),
    ),
}


def main() -> None:
    """Print seconds, what was named and the gain."""
    given = measure.options(__doc__)
    measure.header(given)
    for runs, limit in {6: 60.0}.items() if given.quick else LIMITS.items():
        for name, hidden in HIDDEN.items():
            data = sea_trials(load_mmg_ship("kcs"), 3, hidden, Trials(runs=runs, samples=60 if given.quick else 120))
            began = time.perf_counter()
            found = diagnose(data, workers=2)
            seconds = time.perf_counter() - began
            named = [c.effect for c in found.causes]
            gain = None if found.gain is None else round(found.gain.relative, 3)
            measure.record(
                given,
                {
                    "runs": runs,
                    "hidden": name,
                    "named": named,
                    "gain": gain,
                    "seconds": round(seconds, 1),
                    "limit": limit,
                },
            )
            print(
                f"{runs} runs, hidden: {name}; named: {', '.join(named) or 'none'}; gain: {gain}; {seconds:.0f} s "
                f"(limit {limit:.0f} s)"
            )


if __name__ == "__main__":
    main()
