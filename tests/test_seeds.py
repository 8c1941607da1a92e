"""Repeatable tests: what is drawn at random depends on the commit alone."""

from __future__ import annotations

import re
from pathlib import Path

from hypothesis import settings

TESTS = Path(__file__).parent
UNSEEDED = re.compile(r"default_rng\(\)|\bsecrets\.|\brandom\.Random\(\)|\buuid4\(|torch\.rand\w*\([\d, ]+\)")
FAULTY_ON_PURPOSE = {"contract/strangers.py"}
"""Models that break the contract by drawing without their seed."""


def test_no_test_draws_without_a_seed() -> None:
    found = {p.relative_to(TESTS).as_posix(): UNSEEDED.search(p.read_text("utf-8")) for p in TESTS.rglob("*.py")}
    assert {name for name, match in found.items() if match} == FAULTY_ON_PURPOSE


def test_hypothesis_draws_the_same_examples_in_every_run() -> None:
    assert settings().derandomize
