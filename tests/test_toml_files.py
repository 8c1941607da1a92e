"""TOML of strangers: one message for whatever the parser chokes on, and numbers that were written as numbers."""

from __future__ import annotations

import pytest
from pydantic import BaseModel, ConfigDict, ValidationError

from shipbench.errors import InputError
from shipbench.toml_files import MOST_TOML, Number, Switch, Whole, fault, read_toml


def read(folder, text: str) -> dict:
    (folder / "a.toml").write_text(text, encoding="utf-8")
    return read_toml(folder / "a.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("dt = ", "Correct the line"),
        ("dt = " + "9" * 5000, "64 bits"),
        ("dt = 0x" + "f" * 5000, "64 bits"),
        ("dt = 9223372036854775808", "64 bits"),
        ("x = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("x = " + "[" * 40 + "]" * 40, "nested too deeply"),
        ("x = " + "{a=" * 40 + "1" + "}" * 40, "nested too deeply"),
        ("[" + ".".join("a" * 20_000) + "]", "more than 32 parts"),
        ('x = {"a" . ' + " . ".join("b" * 20_000) + " = 1}", "more than 32 parts"),
        ("x = 1\nx = 2", "Correct the line"),
        ("#" * (MOST_TOML + 1), "accepted: a TOML file of up to 8 MB"),
    ],
)
def test_what_is_no_toml_is_refused_in_one_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_text_with_many_dots_and_words_is_read(tmp_path):
    text = "e.g. " * 100 + "." * 500 + "a" * 100_000 + " 1.2.3"
    assert read(
        tmp_path, f'notes = ["{text}"]\nx = [{"1.0, " * 100}]\nkeys.of.some.parts = 1\nleast = -9223372036854775808'
    )["notes"] == [text]


def test_a_key_without_end_is_refused(tmp_path):
    with pytest.raises(InputError):
        read(tmp_path, ".".join("a" * 2_000_000) + " = 1")


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    dt: Number = 1.0
    kt: tuple[Number, Number] = (0.0, 0.0)
    folds: Whole = 1
    on: Switch = True


@pytest.mark.parametrize("wrong",
    [{"dt": "1"}, {"dt": True}, {"dt": float("nan")}, {"dt": 10**400}, {"kt": [float("inf"), 0]}, {"kt": ["1", 0]},
                                   {"folds": "5"}, {"folds": True}, {"folds": 2.5}, {"on": 1},
                                   {"on": "yes"}])  # fmt: skip
def test_numbers_are_numbers_and_switches_are_switches(wrong):
    with pytest.raises(ValidationError) as caught:
        Part.model_validate(wrong)
    (key, value), (place, _, text) = *wrong.items(), fault(caught.value)
    assert place[0] == key
    assert len(text) < 200
    assert "(value: " in text
    assert "Value error" not in text
    assert not isinstance(value, str) or value in text


def test_whole_numbers_serve_as_numbers_and_the_other_way_round():
    assert Part.model_validate({"dt": 2, "folds": 3.0, "on": False}).model_dump() == {
        "dt": 2.0,
        "kt": (0.0, 0.0),
        "folds": 3,
        "on": False,
    }
