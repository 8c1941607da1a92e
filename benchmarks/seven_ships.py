"""The seven ships of the checks of the diagnosis: three drawn variants of KCS and KVLCC2, and those of the literature
in their authors' equations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipbench.physics.mmg import MMGShip
from shipbench.records import Dataset
from shipbench.ship import Ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.ships import draw_ship

_DRAWN = 3
SHIPS = [*(f"drawn {i + 1}" for i in range(_DRAWN)), *PUBLISHED]


def trials(number: int, draw: int, seed: int, hidden: Sequence[Hidden] = (), plan: Trials | None = None) -> Dataset:
    """What ship `number` of a draw recorded, with her own ship file."""
    if number < _DRAWN:
        return sea_trials(_drawn(draw)[number], seed, hidden, plan)
    return published_trials(PUBLISHED[SHIPS[number]], seed, hidden, plan)


def particulars(number: int, draw: int) -> Ship:
    """The ship file of ship `number` of a draw."""
    return _drawn(draw)[number].particulars if number < _DRAWN else PUBLISHED[SHIPS[number]].particulars


def _drawn(draw: int) -> list[MMGShip]:
    rng = np.random.default_rng(draw)
    return [draw_ship(rng, "test", False) for _ in range(_DRAWN)]
