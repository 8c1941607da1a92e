"""Candidates beside the plain model, without a refit."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.diagnosis.selection.screening import _wrong_way, other_kinds_from
from shipbench.effects.base import EFFECTS
from shipbench.estimation.term import Term


@pytest.mark.parametrize(
    ("name", "estimate", "wrong"),
    [
        ("rudder_lag", -0.2, True),
        ("rudder_lag", 0.2, False),
        ("shallow_water", -0.1, True),
        ("heading_bias", -0.2, False),
    ],
)
def test_what_only_slows_or_narrows_is_no_candidate_for_the_contrary(name, estimate, wrong):
    assert _wrong_way(Term(EFFECTS.get(name)), np.array([estimate])) == wrong
    assert not _wrong_way(Term(EFFECTS.get("current")), np.array([estimate, estimate]))


@pytest.mark.parametrize(
    ("kinds", "other"),
    [
        ("tztztztz", []),
        ("ttttzzzz", [3, 4, 5]),
        ("tttttttt", []),
        ("tttt?zzz", []),
        ("ttztttzttz", []),
        ("ttttttttzz", [7]),
        ("tz", []),
    ],
)
def test_other_kinds_of_manoeuvre_begin_where_less_than_half_is_alike(kinds: str, other: list[int]):
    assert other_kinds_from(["" if k == "?" else k for k in kinds]) == other


def test_kinds_that_come_in_random_order_leave_places_for_a_change():
    """Of six kinds in 24 runs less than half is alike before and after any run, as in most random orders; apart in
    order, all places are barred."""
    barred = other_kinds_from("szzzzrrczcttteetssreress")
    assert 15 not in barred
    assert len(barred) < 13
    assert other_kinds_from("sssszzzzrrrrcccctttteeee") == [*range(3, 22)]
