"""Progress: lines with the remaining time, silence when quiet."""

from __future__ import annotations

import io
import sys
import types

import pytest

from shipbench.bench.durations import Remaining
from shipbench.bench.progress import Bar, Lines, Silent, duration, make_progress, steps_shown
from shipbench.steps import step


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0 s"), (59.2, "59 s"), (185, "3 min 05 s"), (4330, "1 h 12 min")])
def test_durations_read_naturally(seconds, text):
    assert duration(seconds) == text


def test_lines_count_and_tell_the_remaining_time(monkeypatch):
    clock = iter([0.0, 0.0, 10.0, 20.0])
    monkeypatch.setattr("shipbench.bench.progress.time.monotonic", lambda: next(clock))
    stream = io.StringIO()
    lines = Lines(stream)
    lines.start(3)
    lines.done("a", "ok")
    lines.done("b", "failed, 1 of 2 runs: no")
    assert stream.getvalue().splitlines() == [
        "   [1/3] a: ok; about 20 s left",
        "   [2/3] b: failed, 1 of 2 runs: no; about 10 s left",
    ]


def test_the_remaining_time_counts_each_kind_at_its_own_cost():
    left = Remaining({"hold": 5, "physics": 2, "mlp": 5})
    assert left.seconds(1.0) is None
    for _ in range(5):
        left.done("hold", 0.1)
    assert left.seconds(1.0) == pytest.approx(0.7 / 0.5)  # 7 pieces at the mean; half of the time is none of theirs
    left.done("physics", 2.0)
    left.done("mlp", 10.0)
    left.done("mlp", 0.0)  # kept: it cost nothing
    assert left.seconds(12.5) == pytest.approx(2.0 + 3 * 10.0)
    assert left.seconds(6.25) == pytest.approx((2.0 + 3 * 10.0) / 2)  # two at a time


@pytest.mark.parametrize(("cells", "said"), [(1, "stopped after 5 s"), (2, "finished in 5 s")])
def test_lines_tell_a_study_that_was_stopped_from_one_that_came_to_its_end(monkeypatch, cells, said):
    clock = iter([0.0, 0.0, *[1.0] * cells, 5.0])
    monkeypatch.setattr("shipbench.bench.progress.time.monotonic", lambda: next(clock))
    stream = io.StringIO()
    lines = Lines(stream)
    lines.start(2)
    for _ in range(cells):
        lines.done("a", "ok")
    lines.finish()
    assert stream.getvalue().splitlines()[-1].strip() == said


def test_quiet_means_silent_and_a_pipe_gets_lines():
    assert isinstance(make_progress(quiet=True), Silent)
    assert isinstance(make_progress(), Lines)


def test_the_bar_prints_a_line_only_for_what_went_wrong(monkeypatch):
    bar, printed = Bar(), []
    monkeypatch.setattr(
        bar.progress.console, "print", lambda *parts, **_: printed.extend(p for p in parts if isinstance(p, str))
    )
    bar.start(2)
    bar.working("a")
    bar.done("a", "ok, 18 runs, fit 1.0 s")
    bar.done("b", "failed, 2 of 2 runs: no")
    bar.finish()
    assert printed == ["b: failed, 2 of 2 runs: no"]
    assert bar.progress.finished


class _Page:
    """What a notebook's kernel offers to show things."""

    def __init__(self):
        self.shown = []

    def update(self, html):
        self.shown.append(html)


def test_a_notebook_gets_one_bar_that_is_redrawn(monkeypatch):
    page = _Page()
    shell = type("ZMQInteractiveShell", (), {})()
    package = types.ModuleType("IPython")
    package.get_ipython = lambda: shell
    package.display = types.ModuleType("IPython.display")
    package.display.HTML, package.display.display = str, lambda html, display_id: page
    monkeypatch.setitem(sys.modules, "IPython", package)
    monkeypatch.setitem(sys.modules, "IPython.display", package.display)
    bar = make_progress()
    bar.start(2)
    bar.working("physics")
    bar.done("physics", "ok")
    assert 'value="1" max="2"' in page.shown[-1]
    assert "left" in page.shown[-1]
    bar.done("mine", "failed: <b>")
    bar.warn("late")
    bar.finish()
    assert "finished in" in page.shown[-1]
    assert page.shown[-1].endswith("<br>mine: failed: &lt;b&gt;<br>warning: late</div>")
    with steps_shown(quiet=False):
        step("fit", 0.0, 1.0)
    assert 'value="0" max="1"></progress> fit' in page.shown[-2]
    assert "ended after" in page.shown[-1]
    package.get_ipython = lambda: None
    assert isinstance(make_progress(), Lines)
