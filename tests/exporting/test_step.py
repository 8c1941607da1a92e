"""The traced step: the numbers of predict, whatever the model carries from step to step."""

from __future__ import annotations

import numpy as np
import pytest
from exporting_cases import CASES, largest

from shipbench.errors import InputError, WorkError
from shipbench.exporting.step import TOLERANCE, step_of
from shipbench.signals import STATES


@pytest.mark.parametrize(("spec", "options"), CASES)
def test_a_rollout_of_steps_is_the_prediction(made, spec, options):
    step = step_of(made(spec, **options))
    rng = np.random.default_rng(1)
    s0 = step.reference.s0 + rng.standard_normal(10) * [50, 50, 1, 0.3, 0.2, 0.002, 5, 0.05, 2e3, 2e3]
    U = step.reference.U[rng.permutation(60)]
    if "depth" in step.model.inputs:
        U[:, step.model.inputs.index("depth")] = 12.0
    assert largest(step.rollout(s0, U), step.model.predict(s0, U)) < TOLERANCE


@pytest.mark.long
def test_the_reference_moves_every_channel(made):
    reference = step_of(made("calibrated", wind=True)).reference
    assert (np.ptp(reference.S, axis=0) > 1e-4).all()
    assert np.ptp(reference.U, axis=0)[[0, 1, 2, 3, 5, 6]].min() > 0.0


@pytest.mark.parametrize(
    ("spec", "memory", "any_step"),
    [
        ("physics", ["n", "delta", "F_b", "F_s"], True),
        ("physics+rudder_delay[delay=2.3]", ["n", "delta", "delta_c_1", "delta_c_2", "delta_c_3", "F_b", "F_s"], False),
        ("physics+rudder_delay[delay=2]", ["n", "delta", "delta_c_1", "delta_c_2", "F_b", "F_s"], False),
        ("physics+rudder_backlash[play=0.03]", ["n", "delta", "delta_motor", "F_b", "F_s"], True),
        ("physics+change_point[effect=rudder_offset,time=9,offset=0.05]", ["n", "delta", "F_b", "F_s", "k"], True),
    ],
)
def test_the_memory_holds_what_the_model_needs_and_no_more(made, spec, memory, any_step):
    step = step_of(made(spec))
    assert [c.name for c in step.memory] == [*STATES[:6], *memory]
    assert step.any_step is any_step


def test_commands_alone_need_no_actuator_in_the_memory(made):
    assert [c.name for c in step_of(made("physics", commanded=True)).memory] == list(STATES[:6])


def test_shorter_steps_come_to_the_same_place(made):
    step = step_of(made("physics"))
    z = step.start(step.reference.s0, step.reference.U[20])
    u = step.reference.U[20]
    _, s = step.step(z, u, 1.0)
    half, _ = step.step(z, u, 0.5)
    _, s_half = step.step(half, u, 0.5)
    assert largest(np.asarray(s_half).ravel(), np.asarray(s).ravel()) < 1e-5  # of the integrator
    assert largest(np.asarray(s_half).ravel()[6:], np.asarray(s).ravel()[6:]) < 1e-12  # actuators are exact


@pytest.mark.parametrize("effect", ["position_delay[delay=2]", "velocity_delay[delay=1,earth_axes=0]"])
def test_a_late_sensor_is_refused(made, effect):
    with pytest.raises(InputError, match=r"effect '\w+_delay' cannot be exported.*dataset.toml"):
        step_of(made(f"physics+{effect}"))


@pytest.mark.parametrize(("delay", "told"), [(-1.5, "-1.5"), (1e7, "1e[+]07"), (float("nan"), "nan")])
def test_a_delay_that_no_step_can_hold_is_refused(made, delay, told):
    model = made("physics+rudder_delay[delay=1]")
    model.extension.values = [(delay,)]
    with pytest.raises(InputError, match=f"its delta follows commands with a delay of {told} s.*from 0 to 1000 s"):
        step_of(model)


def test_inputs_and_sample_times_that_no_step_can_hold_are_refused(made):
    model = made("physics")
    model.substeps = 51
    with pytest.raises(InputError, match="is 51 integration steps of a ship of 130 m; accepted: up to 50"):
        step_of(model)
    model = made("physics")
    model.inputs = ("delta_c", "n_c", "F_b_c", "F_s_c")
    with pytest.raises(InputError, match="inputs are delta_c, n_c"):
        step_of(model)


def test_a_formula_that_takes_no_symbols_is_one_message(made, monkeypatch):
    model = made("physics+current[speed=0.4,to=1]")

    def force(self, e, s, q, ship):
        e.X = s.u if s.u > 1.0 else 0.0

    monkeypatch.setattr(type(model.extension.terms[0].effect), "force", force)
    with pytest.raises(InputError, match="takes no symbols"):
        step_of(model)


def test_a_model_that_diverges_or_differs_is_not_exported(made, monkeypatch):
    model = made("physics")
    model.p = model.p * 1e9
    with pytest.raises(WorkError, match="diverges within 60 s"):
        step_of(model)
    other = made("physics")
    predict = other.predict
    monkeypatch.setattr(other, "predict", lambda *args: predict(*args) * (1 + 1e-8))
    with pytest.raises(WorkError, match="differs from predict"):
        step_of(other)
