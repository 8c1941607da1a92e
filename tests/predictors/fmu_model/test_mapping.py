"""Mappings: units of the model description, units and signs that a person states, constants, and what is refused."""

from __future__ import annotations

import math

import pytest
from made_fmu import STATES, description, write_archive

from shipbench.errors import InputError
from shipbench.predictors.fmu_model.description import read_description
from shipbench.predictors.fmu_model.mapping import Mapping, mapping_of, open_parameters

GOOD = {"inputs": {"n_c": '"n_c"', "delta_c": '"delta_c"'}, "outputs": {s: f'"{s}"' for s in ("u", "v", "r")}}
DEG = '<Unit name="deg"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit>'


@pytest.fixture
def mapped(tmp_path):
    """Function of the text of modelDescription.xml and of changes of a good mapping."""

    def made(text: str = "", **tables: dict[str, str]) -> Mapping:
        path = write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": text or description()})
        if tables:
            merged = {name: GOOD.get(name, {}) | tables.get(name, {}) for name in {**GOOD, **tables}}
            lines = [f"[{t}]\n" + "\n".join(f"{k} = {v}" for k, v in rows.items() if v) for t, rows in merged.items()]
            path.with_name("ship.fmu.toml").write_text("\n".join(lines))
        return mapping_of(read_description(path))

    return made


def factor(mapping: Mapping, channel: str) -> float:
    return next(link.factor for link in mapping.inputs + mapping.outputs if link.channel == channel)


def test_equal_names_need_no_mapping(mapped):
    found = mapped()
    assert [link.channel for link in found.inputs] == ["n_c", "delta_c"]
    assert [link.channel for link in found.outputs] == list(STATES)
    assert [link.variable.name for link in found.start] == list(STATES)
    assert factor(found, "n_c") == pytest.approx(1.0)
    assert found.own_start == ()


def test_start_parameters_are_found_by_their_names(mapped):
    start = (
        '<ScalarVariable name="u_start" valueReference="80" causality="parameter"><Real start="1"/></ScalarVariable>'
    )
    text = description(extra=start).replace(
        '<ScalarVariable name="u" valueReference="5" causality="output" variability="continuous" initial="exact">',
        '<ScalarVariable name="u" valueReference="5" causality="output">',
    )
    found = mapped(text)
    assert {link.channel: link.variable.name for link in found.start}["u"] == "u_start"


def test_units_of_the_model_description_are_converted(mapped):
    text = (
        description()
        .replace('name="delta_c" v', 'name="delta_c" v', 1)
        .replace("</UnitDefinitions>", f"{DEG}</UnitDefinitions>")
    )
    at = text.index('name="delta_c"')
    text = text[:at] + text[at:].replace('unit="rad"', 'unit="deg"', 1)
    assert factor(mapped(text), "delta_c") == pytest.approx(math.pi / 180.0)


def test_a_unit_that_is_only_a_name_is_known(mapped):
    at = (text := description()).index('name="u"')
    assert factor(mapped(text[:at] + text[at:].replace('unit="m/s"', 'unit="kn"', 1)), "u") == pytest.approx(
        0.51444, rel=1e-4
    )


def test_stated_units_signs_and_offsets_win(mapped):
    found = mapped(
        inputs={"delta_c": '{ variable = "delta_c", unit = "deg", sign = "port" }'},
        outputs={"psi": '{ variable = "psi", unit = "deg", sign = "counterclockwise", offset = -90 }', "v": "0.0"},
    )
    assert factor(found, "delta_c") == pytest.approx(-math.pi / 180.0)
    psi = next(link for link in found.outputs if link.channel == "psi")
    assert psi.factor * 90.0 + psi.offset == pytest.approx(0.0)  # 90 deg counterclockwise from east is north
    assert psi.factor * 0.0 + psi.offset == pytest.approx(math.pi / 2)
    assert found.fixed == {"v": 0.0}


WAVE = '<ScalarVariable name="wave" valueReference="81" causality="input"><Real start="0"/></ScalarVariable>'


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"inputs": {"delta_c": '"ruder"'}}, r"unknown variable in \[inputs\] of .*'ruder'"),
        ({"inputs": {"delta_c": '"Xuu"'}}, "is of the causality parameter; accepted: n_c, delta_c"),
        ({"inputs": {"ruder": '"delta_c"'}}, r"unknown channel in \[inputs\] of .*'ruder'"),
        (
            {"inputs": {"delta_c": '{ variable = "delta_c", units = "deg" }'}},
            "no parameter 'units'. Did you",
        ),
        ({"inputs": {"delta_c": '{ variable = "delta_c", unit = "kn" }'}}, "unknown unit of 'delta_c' 'kn'"),
        ({"inputs": {"delta_c": '{ variable = "delta_c", sign = "left" }'}}, "unknown sign of 'delta_c' 'left'"),
        ({"inputs": {"delta_c": ""}}, "the FMU's input 'delta_c' has no channel.*--propose"),
        ({"outputs": {"u": ""}}, "the FMU has no output for u; needed: u, v, r"),
        ({"outputs": {"u": '"psi"'}}, "u \\[m/s\\] is mapped to 'psi' \\[rad\\], which is of another quantity"),
        ({"outputs": {"x": '"x"'}}, "x and y serve only together"),
        ({"outputs": {"u": "true"}}, "outputs.u"),
        ({"bounds": {"Xuu": "[1.0, 0.0]"}}, r"\[bounds\] Xuu = \[1, 0\]; accepted: \[lower, higher\]"),
        ({"constants": {"Xuw": "1.0"}}, "Did you mean 'Xuu'"),
        ({"constant": {"Xuu": "1.0"}}, "has no parameter 'constant'. Did you mean 'constants'"),
    ],
)
def test_a_wrong_entry_is_one_message(tables, message, mapped):
    with pytest.raises(InputError, match=message):
        mapped(**tables)


def test_an_input_without_a_channel_is_refused_and_a_constant_settles_it(mapped):
    with pytest.raises(
        InputError, match=r"the FMU's input 'wave' has no channel\. Accepted: an entry in \[inputs\], or"
    ):
        mapped(description(extra=WAVE))
    assert [(v.name, value) for v, value in mapped(description(extra=WAVE), constants={"wave": "0.5"}).constants] == [
        ("wave", 0.5)
    ]


def test_what_cannot_be_set_is_no_start(mapped):
    text = description().replace('initial="exact"', "", 1)
    with pytest.raises(InputError, match="'x' cannot be set before the simulation"):
        mapped(text, start={"x": '"x"'})


def test_bounds_come_from_the_mapping_then_the_description_then_the_value(mapped, tmp_path):
    text = description().replace(' min="0.19999999999999998" max="1.7999999999999998"', "")
    found = mapped(text, bounds={"Xuu": "[-1.0, -1e-5]"})
    read = read_description(tmp_path / "ship.fmu")
    by_name = {v.name: (value, low, high) for v, value, low, high in open_parameters(read, found, ["Xuu", "Xvr", "Nd"])}
    assert by_name["Xuu"] == (-4e-4, -1.0, -1e-5)
    assert by_name["Xvr"] == pytest.approx((0.6, 0.0, 1.8))
    assert by_name["Nd"] == pytest.approx((-6e-5, -1.8e-4, -2e-5))
