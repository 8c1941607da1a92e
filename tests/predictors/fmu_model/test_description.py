"""Model descriptions of FMI 2 and 3: variables, units, bounds; hostile and wrong ones are one message."""

from __future__ import annotations

import math

import pytest
from made_fmu import TRUE, description, write_archive

from shipbench.errors import InputError
from shipbench.predictors.fmu_model.description import Description, read_description


@pytest.fixture
def read(tmp_path):
    def made(text: str) -> Description:
        return read_description(write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": text}))

    return made


@pytest.mark.parametrize("fmi", [2, 3])
def test_variables_units_and_bounds_are_read(fmi, read):
    found = read(description(fmi))
    assert (found.version, found.name, found.states, found.events, found.step) == (fmi, "ship", 8, 0, 0.25)
    assert set(found.identifiers) == {"co-simulation", "model-exchange"}
    assert [v.name for v in found.of("input")] == ["n_c", "delta_c"]
    Xuu = found.variables["Xuu"]
    assert (Xuu.causality, Xuu.start, Xuu.settable) == ("parameter", TRUE["Xuu"], True)
    assert Xuu.low < Xuu.start < Xuu.high
    assert found.units["rpm"].factor == pytest.approx(math.pi / 30.0)
    assert dict(found.units["rpm"].exponents) == {"s": -1, "rad": 1}


def test_a_declared_type_gives_unit_and_bounds(read):
    types = '<TypeDefinitions><SimpleType name="Gain"><Real unit="rad" min="0" max="2"/></SimpleType></TypeDefinitions>'
    extra = (
        '<ScalarVariable name="gain" valueReference="77" causality="parameter" variability="fixed">'
        '<Real declaredType="Gain" start="1"/></ScalarVariable>'
    )
    found = read(description(2, extra=extra).replace("<DefaultExperiment", f"{types}<DefaultExperiment"))
    gain = found.variables["gain"]
    assert (gain.unit, gain.start, gain.low, gain.high) == ("rad", 1.0, 0.0, 2.0)


def test_arrays_and_other_types_are_no_real_scalars(read):
    extra = (
        '<Float64 name="many" valueReference="70" causality="input"><Dimension start="3"/></Float64>'
        '<Boolean name="on" valueReference="71" causality="input" start="true"/>'
    )
    found = read(description(3, extra=extra))
    assert found.others == ("many", "on")
    assert not {"many", "on"} & set(found.variables)


BOMB = '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("<fmiModelDescription", f"{BOMB}<fmiModelDescription"), "document type"),
        (lambda t: t.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), "FMI version '1.0'; accepted: 2.0 and 3.0"),
        (lambda t: t[:-60], "is not valid"),
        (lambda t: t.replace('start="3.0"', 'start="three"'), "start = 'three' of .* is no number"),
        (lambda t: t.replace('valueReference="4"', 'valueReference="x"'), "is not valid"),
        (lambda t: t.replace('modelIdentifier="ship"', 'modelIdentifier="../ship"'), "no name of a library"),
        (lambda t: t.replace("ModelExchange", "A").replace("CoSimulation", "B"), "neither co-simulation nor model"),
        (lambda t: "<a/>", "FMI version ''"),
        (lambda t: t.replace("ModelVariables", "Variables"), "no ModelVariables"),
    ],
)
def test_a_hostile_or_wrong_description_is_one_message(change, message, read):
    with pytest.raises(InputError, match=message):
        read(change(description(2)))


def test_an_archive_without_description_is_no_fmu(tmp_path):
    with pytest.raises(InputError, match=r"is no FMU: it holds no modelDescription\.xml"):
        read_description(write_archive(tmp_path / "ship.fmu", {"readme": "x"}))
