"""Cost of a term of the model."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.estimation.term import Term


def test_what_was_chosen_among_many_costs_more():
    """Twice log of the number of shapes, or of runs where it may begin; a random effect for its variance."""
    bank, wind = EFFECTS.get("bank_suction"), EFFECTS.get("wind_per_run")
    assert Term(bank, (0.0, 100.0), choices=4).cost(24) == pytest.approx(2.0 * np.log(4.0))
    assert Term(EFFECTS.get("list"), ()).cost(24) == 0.0
    assert Term(EFFECTS.get("list"), (), since=7).cost(24) == pytest.approx(2.0 * np.log(24.0))
    assert Term(wind, (), per_run=True).cost(24) > np.log(24.0)
