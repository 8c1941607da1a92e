"""The force law as JSON."""

from __future__ import annotations

import json
from dataclasses import fields

import pytest
from exporting_cases import CURRENT, GEARS

from shipbench.exporting import force_law
from shipbench.exporting.step import step_of
from shipbench.physics import eq2


def test_every_parameter_has_value_unit_and_meaning(made, tmp_path):
    model = made(f"physics+{CURRENT}+{GEARS}")
    force_law.write(step_of(model), "ship", tmp_path / "ship.json")
    law = json.loads((tmp_path / "ship.json").read_text())
    rows = {row["name"]: row for row in law["parameters"]}
    assert len(rows) == len(law["parameters"])
    assert all(set(row) == {"name", "value", "unit", "meaning"} and row["meaning"] for row in law["parameters"])
    for i, value in enumerate(model.p):
        assert rows[f"p{i}"]["value"] == value
    assert {f.name for f in fields(eq2.Coefficients)} <= {name.split(".")[0] for name in rows}
    assert rows["delta.delay"] == {
        "name": "delta.delay", "value": 1.3, "unit": "s", "meaning": "delay of the command, actuator delta"
    }  # fmt: skip
    assert rows["rudder_backlash.play"]["value"] == 0.03
    assert rows["n.rate"]["unit"] == "rpm/s"
    assert law["dt"] == 1.0
    assert law["ship"]["name"] == model.ship.name
    assert [c["name"] for c in law["states"]][:3] == ["x", "y", "psi"]
    assert "\n".join(law["equations"]) == model.describe()
    assert law["training"]["fingerprint"] == model.origin.fingerprint
    assert len(model.origin.fingerprint) == 16


@pytest.mark.long
@pytest.mark.parametrize("name", ["hull_derivatives.Y_v", "p5"])
def test_a_calibrated_ship_tells_what_it_changed(made, name):
    law = force_law.document(step_of(made("calibrated")), "ship")
    assert name in {row["name"] for row in law["parameters"]}
