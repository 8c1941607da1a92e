"""The variables of an FMU."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from shipbench.exporting.fmi_description import model_description, variables
from shipbench.exporting.step import step_of
from shipbench.signals import STATES


def test_inputs_states_and_starts_have_references_of_their_own(made):
    found = list(variables(step_of(made("physics", wind=True))))
    assert [v.reference for v in found] == list(range(1, len(found) + 1))
    assert [v.name for v in found if v.causality == "output"] == list(STATES)
    assert [v.name for v in found if v.causality == "parameter"] == [f"{name}_start" for name in STATES]
    assert {v.name: v.unit for v in found if v.causality == "input"} == {
        "n_c": "rpm", "delta_c": "rad", "F_b_c": "N", "F_s_c": "N", "depth": "m", "wind_speed": "m/s",
        "wind_from": "rad",
    }  # fmt: skip


@pytest.mark.parametrize("fmi", [2, 3])
def test_it_says_which_communication_steps_are_accepted(made, fmi):
    texts = [
        model_description(step_of(made(spec)), "ship", "token", fmi).decode()
        for spec in ("physics", "physics+rudder_delay[delay=1.3]")
    ]
    assert "Any communication step" in texts[0]
    assert "multiples of 1.0 s" in texts[1]
    found = [next(ET.fromstring(text.encode()).iter("CoSimulation")).attrib for text in texts]
    assert [f["canHandleVariableCommunicationStepSize"] for f in found] == ["true", "false"]
