"""The forward model of recorded runs: an actuator whose record stands still is not at work."""

from __future__ import annotations

import numpy as np

from shipbench.diagnosis.preparation.plant import plant_of
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Run
from shipbench.signals import COMMANDS, DELTA
from shipbench.simulate.trials import Trials, sea_trials


def test_a_rudder_whose_record_stands_still_while_the_ship_turns_is_not_at_work():
    data = sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=12, thrusters=False, astern=False))
    assert plant_of(data).seg.working == {"n", "delta"}
    rudder = COMMANDS.index("delta_c")

    def stuck(run: Run) -> Run:
        states, inputs = run.states.copy(), run.inputs.copy()
        states[:, DELTA], inputs[:, rudder] = np.deg2rad(0.5), np.deg2rad(0.5)
        return Run(run.id, run.t, states, inputs)

    assert plant_of(data.with_runs([stuck(run) for run in data.runs])).seg.working == {"n"}
