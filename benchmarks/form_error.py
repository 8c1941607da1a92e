"""Form error of development ships: `python benchmarks/form_error.py`.

Ships of the diagnosis suite (kinds `none-published` and `none-other`, development, nothing hidden) sail 12 runs in calm
air with sensors ten times as good as ordinary ones. Printed are the standard deviations of a form error
(`shipbench/diagnosis/selection/form_error.py`) on each axis that have the highest evidence, in force scales, and twice
the log evidence over none. The diagnosis takes the least latent force (`least_spread`), which comes near their mean
over axes and ships.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipbench.diagnosis.selection.analysis import plain_model
from shipbench.diagnosis.selection.form_error import FormError
from shipbench.estimation.forward import Plant
from shipbench.simulate.trials import Trials
from shipbench.suites.diagnosis.cases import draw_case

SETS = (("none-published", 8), ("none-other", 4))
SEED = 59
SIZES = (0.0, 0.02, 0.04, 0.08, 0.16, 0.32)
EXACT = Trials(runs=12, noise=0.1, gusts=0.0)


def likeliest(form: FormError) -> list[float]:
    """Standard deviations of highest evidence on the three axes, one after the other, twice over."""
    found = [SIZES[2]] * 3
    for axis in (0, 1, 2) * 2:
        found[axis] = max(SIZES, key=lambda size: form.evidence([*found[:axis], size, *found[axis + 1 :]]))
    return found


def main() -> None:
    """Print one line a ship, and the mean."""
    every = []
    print(f"{'set':<18} {'ship':<32} {'surge':>6} {'sway':>6} {'yaw':>6} {'gain':>6}")
    for kind, number in SETS:
        for index in range(number):
            case = replace(draw_case(kind, index, SEED, "development"), plan=EXACT)
            form = FormError(plain_model(Plant.of(case.dataset())))
            found = likeliest(form)
            gain = 2.0 * (form.evidence(found) - form.evidence([0.0] * 3))
            every.append(found)
            sizes = " ".join(f"{size:6.2f}" for size in found)
            print(f"{kind + ' ' + str(index):<18} {case.ship.name:<32} {sizes} {gain:6.0f}")
    mean, square = np.mean(every), np.mean(np.square(every)) ** 0.5
    print(
        f"mean {mean:.3f}, root mean square {square:.3f}, of {np.size(every)}; {np.mean(np.array(every) > 0):.0%} > 0"
    )


if __name__ == "__main__":
    main()
