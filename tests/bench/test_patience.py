"""Workers that are not there: told within seconds, then each minute, and given up where the user says so."""

from __future__ import annotations

import threading
from concurrent.futures import Future

import pytest

from shipbench.bench import patience
from shipbench.bench.patience import Patience
from shipbench.bench.progress import Silent
from shipbench.errors import WorkError


class NoWorkers:
    def missing(self):
        return "no workers at tcp://a:1; start one with `dask worker tcp://a:1`"


class Told(Silent):
    def __init__(self):
        self.texts = []

    def warn(self, text):
        self.texts.append(text)


@pytest.fixture
def quick(monkeypatch):
    for name, seconds in (("LOOK_S", 0.01), ("FIRST_S", 0.05), ("AGAIN_S", 0.2)):
        monkeypatch.setattr(patience, name, seconds)


def test_a_cluster_without_workers_is_told_and_told_again(quick):
    told, future = Told(), Future()
    threading.Timer(0.5, future.set_result, [None]).start()
    assert Patience(NoWorkers(), told).first_done([future]) == {future}
    assert 2 <= len(told.texts) <= 3
    assert told.texts[0].startswith("no workers at tcp://a:1; start one with `dask worker tcp://a:1`. Waiting for ")
    assert "1 jobs to do" in told.texts[0]


def test_the_wait_has_an_end_where_the_user_gives_one(quick):
    with pytest.raises(WorkError, match=r"gave up after .* \(--wait 0.1\): no workers at tcp://a:1.*--resume"):
        Patience(NoWorkers(), Told(), 0.1).first_done([Future()])


def test_the_first_word_comes_within_ten_seconds_and_the_next_after_a_minute():
    assert patience.FIRST_S + 2 * patience.LOOK_S < 10.0
    assert patience.AGAIN_S == 60.0
