"""The words of a diagnosis, for every effect."""

import re

import pytest

from shipbench.bench.diagnosis_text import cause_lines
from shipbench.diagnosis.outcome import Cause, Estimate
from shipbench.effects.base import EFFECTS

BANNED = re.compile(r"\b(told|knots?|felt|heals?|misread)\b", re.IGNORECASE)


@pytest.mark.parametrize("name", EFFECTS.built_in())
def test_a_cause_is_reported_in_short_sentences_with_its_typed_name(name):
    effect = EFFECTS.get(name)
    sizes = {p.name: Estimate(p.typical, p.unit, (0.8 * p.typical, 1.2 * p.typical)) for p in effect.parameters}
    if effect.vector:
        sizes = {effect.vector[0]: Estimate(0.36, "m/s", (0.34, 0.37)), effect.vector[1]: Estimate(1.03, "rad", (1.0, 1.05))}
    lines = cause_lines(Cause(name, 1, 400.0, 0.001, sizes, ("wind",), "a full turn", None, "12 of 12 runs support it"), 80)
    text = " ".join(" ".join(lines).split())
    assert max(map(len, lines)) <= 80
    assert f"1. {name}: {effect.summary}" in text
    assert "very strong evidence, log Bayes factor 200" in text
    assert not BANNED.search(text)
    if effect.vector:
        assert f"{effect.vector[1]} 059° (95 %: 057° to 060°)" in text
    for p in effect.parameters:
        if p.relative:
            assert f"{p.title} {p.name} {100 * p.typical:.0f} % larger" in text
