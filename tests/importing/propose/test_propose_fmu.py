"""Draft of an FMU's mapping: it is complete where names tell, and says what is missing where they do not."""

from __future__ import annotations

import json
import re

import pytest
from made_fmu import description, write_archive
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.errors import InputError
from shipbench.importing.propose.fmu import write_fmu_proposal
from shipbench.predictors.fmu_model.description import read_description
from shipbench.predictors.fmu_model.mapping import mapping_of

OTHER = dict(n_c="shaft_speed_cmd", delta_c="rudder_angle_order_port_positive", x="pos.north", y="pos.east",
             psi="heading", u="surge_velocity", v="sway_velocity", r="yaw_rate", n="propeller_rpm",
             delta="rudder_angle")  # fmt: skip
WAVE = '<ScalarVariable name="wave height" valueReference="81" causality="input"><Real start="0.5"/></ScalarVariable>'


@pytest.fixture
def drafted(tmp_path):
    def made(text: str):
        fmu = write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": text})
        remarks = write_fmu_proposal(fmu, tmp_path / "ship.fmu.toml")
        return fmu, remarks, (tmp_path / "ship.fmu.toml").read_text()

    return made


def test_names_of_others_are_understood_and_the_draft_is_complete(drafted):
    fmu, remarks, text = drafted(description(rename=OTHER, extra=WAVE))
    found = mapping_of(read_description(fmu))
    assert {link.channel: link.variable.name for link in (*found.inputs, *found.outputs)} == OTHER
    assert next(link.factor for link in found.inputs if link.channel == "delta_c") == -1.0
    assert [link.channel for link in found.start] == ["x", "y", "psi", "u", "v", "r", "n", "delta"]
    assert [(v.name, value) for v, value in found.constants] == [("wave height", 0.5)]
    assert text.count("# GUESS") == 19
    assert remarks == [f"shipbench check {fmu}"]


def test_start_parameters_and_descriptions_count(drafted):
    text = description(rename={"delta_c": "in1", "n_c": "in2"})
    text = text.replace('name="in1"', 'name="in1" description="Rudder angle command"').replace('initial="exact"', "")
    start = '<ScalarVariable name="r_0" valueReference="82" causality="parameter"><Real start="0"/></ScalarVariable>'
    fmu, remarks, _ = drafted(text.replace("</ModelVariables>", f"{start}</ModelVariables>"))
    found = mapping_of(read_description(fmu))
    assert {link.channel: link.variable.name for link in found.inputs} == {"n_c": "in2", "delta_c": "in1"}
    assert {link.channel: link.variable.name for link in found.start} == {"r": "r_0"}
    assert "The start value of u cannot be set." in remarks
    assert found.own_start == ("u", "v")


def test_what_is_missing_is_said_in_the_draft(drafted):
    _, remarks, text = drafted(description(rename={"u": "a1", "v": "a2"}))
    assert "MISSING: no output for u" in remarks
    assert '# u = "?"  # MISSING: a variable, or a number' in text
    assert any("To complete:" in line for line in remarks)


def test_a_draft_replaces_nothing_without_force(drafted, tmp_path):
    fmu, _, _ = drafted(description())
    with pytest.raises(InputError, match="is there already"):
        write_fmu_proposal(fmu, tmp_path / "ship.fmu.toml")
    assert write_fmu_proposal(fmu, tmp_path / "ship.fmu.toml", force=True)
    with pytest.raises(InputError, match="among the inputs"):
        write_fmu_proposal(fmu, fmu, force=True)


def test_the_command_explains_an_fmu_and_writes_its_draft(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": description(rename=OTHER, extra=WAVE)})
    run = CliRunner()
    told = run.invoke(app, ["models", "ship.fmu"]).output
    assert "FMI 2, model-exchange and co-simulation" in told or "FMI 2, co-simulation and model-exchange" in told
    assert "surge_velocity [m/s]" in told
    assert "To be completed" in told
    assert "It does not run here: ship.fmu has libraries for no platform" in " ".join(told.split())
    written = run.invoke(app, ["models", "ship.fmu", "--propose", "ship.fmu.toml"])
    assert written.exit_code == 0
    assert "shipbench check ship.fmu" in written.output
    document = json.loads(run.invoke(app, ["models", "ship.fmu", "--json"]).stdout)
    assert document["mapping"] == "complete"
    assert document["parameter"][-1]["name"] == "trouble"
    assert document["parameter"][-1]["low"] is None
    assert document["runs_here"] is False
    refused = run.invoke(app, ["models", "physics", "--propose", "x.toml"])
    assert isinstance(refused.exception, InputError) or refused.exit_code == 2


def test_a_unit_in_the_name_counts_where_the_description_has_none(drafted):
    text = description(rename={"delta_c": "rudder_order_deg", "r": "yaw_rate_degs"})
    _, _, draft = drafted(re.sub(r' unit="(rad|rad/s)"', "", text))
    assert 'delta_c = { variable = "rudder_order_deg", unit = "deg" }' in draft
    assert "[deg] by its name" in draft
    assert 'r = { variable = "yaw_rate_degs", unit = "deg/s" }' in draft


def test_a_very_long_name_is_cut_in_the_list(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": description(rename={"u": "u" * 10_000})})
    said = CliRunner().invoke(app, ["models", "ship.fmu"]).output
    assert "uuu ... [" in " ".join(said.split())  # wherever a line ends
