"""The wind that the diagnosis sees in the motion of the Esso Osaka alone, beside the anemometer.

    python benchmarks/esso_osaka_wind.py  # 15 to 40 minutes of one core; reads the local copy of the data

The diagnosis is given the runs without their wind channels. Where it names a wind per run, its value for every run
(north and east, of where the wind comes from) is compared with the mean of the anemometer over that run, which it has
not seen.
"""

from __future__ import annotations

import numpy as np

from shipbench import load_dataset
from shipbench.diagnosis.preparation.time_offsets import late_effects, late_velocities_of
from shipbench.diagnosis.selection.analysis import analyse, plain_model
from shipbench.estimation.forward import Plant
from shipbench.records import Dataset


def measured(data: Dataset) -> np.ndarray:
    """Mean wind of every run (runs, 2): north and east components of where it comes from [m/s]."""
    found = []
    for run in data.runs:
        speed, from_ = (run.inputs[:, run.inputs_names.index(name)] for name in ("wind_speed", "wind_from"))
        found.append([np.mean(speed * np.cos(from_)), np.mean(speed * np.sin(from_))])
    return np.array(found)


def seen(data: Dataset) -> np.ndarray | None:
    """The same from the motion alone, or None where no wind per run is named."""
    late = late_velocities_of(data)
    found = analyse(
        plain_model(Plant.of(data if late is None else late[1]), settled=() if late is None else late_effects())
    ).final
    for term, value in zip(found.model.terms, found.values, strict=True):
        if term.label == "wind_per_run":
            public = [term.effect.public(row) for row in value * found.scales.amplitudes(term, found.plant.c.L)]
            return np.array([[p["speed"] * np.cos(p["from"]), p["speed"] * np.sin(p["from"])] for p in public])
    return None


def main() -> None:
    truth, guess = measured(load_dataset("esso_osaka")), seen(load_dataset("esso_osaka[wind=false]"))
    if guess is None:
        raise SystemExit("no wind per run was named.")
    turned = abs(np.degrees(np.angle(np.exp(1j * (np.arctan2(*guess.T[::-1]) - np.arctan2(*truth.T[::-1]))))))
    strong = np.hypot(*guess.T) > np.median(np.hypot(*guess.T))
    rows = {
        "anemometer, root mean square [m/s]": np.sqrt(np.mean(truth**2, axis=0)),
        "seen, root mean square [m/s]": np.sqrt(np.mean(guess**2, axis=0)),
        "difference, root mean square [m/s]": np.sqrt(np.mean((guess - truth) ** 2, axis=0)),
        "correlation over runs": [np.corrcoef(a, b)[0, 1] for a, b in zip(guess.T, truth.T, strict=True)],
    }
    print("                                     north   east")
    for name, values in rows.items():
        print(f"{name:35} {values[0]:6.2f} {values[1]:6.2f}")
    print(f"direction off by [deg], median of {len(turned)} runs: {np.median(turned):.0f}; of the {strong.sum()} "
          "with the most wind seen: "
          f"{np.median(turned[strong]):.0f} (90 would be chance)")  # fmt: skip


if __name__ == "__main__":
    main()
