"""Pool of processes: one that is ended is one message."""

import os

import pytest

from shipbench.errors import WorkError
from shipbench.processes import process_pool


def test_a_process_that_is_ended_is_one_message():
    with (
        pytest.raises(WorkError, match=r"ended before it answered: .*memory runs out.* Fit all here: --workers 1\."),
        process_pool(1, "Fit all here: --workers 1.") as pool,
    ):
        pool.submit(os.abort).result()


def test_an_error_of_the_work_passes_through():
    with pytest.raises(ValueError, match="'a'"), process_pool(1, "") as pool:
        pool.submit(int, "a").result()
