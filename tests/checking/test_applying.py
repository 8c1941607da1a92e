"""Lines of findings add to what dataset.toml says; contradictions are left out; the file keeps its comments."""

from __future__ import annotations

import tomllib

import pytest

from shipbench.checking.applying import laid, write_lines
from shipbench.checking.finding import Finding
from shipbench.errors import InputError

HEAD = 'name = "a"\ndt = 1.0\nactuators = "measured"\n'


def findings(*lines: str) -> list[Finding]:
    return [Finding("some", "error", "fault", "text", line) for line in lines]


@pytest.mark.parametrize(
    ("given", "line", "result"),
    [
        ("[scale]\nu = 1.1", "[scale]\nu = 1.1", {"scale": {"u": 1.21}}),
        ("[bias]\nr = 0.01\n[scale]\nr = 2.0", "[bias]\nr = 0.01", {"bias": {"r": 0.03}, "scale": {"r": 2.0}}),
        ("[bias]\nr = 0.01", "[runs.a.bias]\nr = 0.02", {"bias": {"r": 0.01}, "runs": {"a": {"bias": {"r": 0.03}}}}),
        ("[delay]\nr = 1.0", "[delay]\nr = 2.0", {"delay": {"r": 3.0}}),
        ("antenna = [1.0, 2.0]", "antenna = [3.0, -2.0]", {"antenna": [4.0, 0.0]}),
        ("[runs.a]\ncut = [[1.0, 2.0]]", "[runs.a]\ncut = [[1.0, 2.0], [0.0, 0.5]]",
            {"runs": {"a": {"cut": [[0.0, 0.5], [1.0, 2.0]]}}}),
        ('[signs]\nx = "south"', '[signs]\nx = "north"', {"signs": {"x": "north"}}),
    ],
)  # fmt: skip
def test_what_was_found_in_corrected_data_adds_to_the_correction(given, line, result):
    assert laid(tomllib.loads(given), findings(line)).description == result


@pytest.mark.parametrize(
    ("given", "lines"),
    [
        ("", ["[delay]\nr = 2.0", "[delay]\nr = -2.0"]),
        ("", ['velocities = "earth"', 'velocities = "water"\ncurrent = [1.0, 0.0]']),
        ('[units]\npsi = "deg"', ['[units]\npsi = "rad"']),
        ('frame = "ENU"', ['frame = "east-north"']),
    ],
)
def test_contradictions_are_left_out_and_said(given, lines):
    result = laid(tomllib.loads(given), findings(*lines, "[scale]\nr = 1.1"))
    assert result.changed == {"scale": {"r": 1.1}}
    assert "contradict" in result.refused[0]


def test_two_estimates_of_one_number_are_no_contradiction():
    assert laid({}, findings("[delay]\npsi = 3.0", "[delay]\npsi = 3.2")).changed == {"delay": {"psi": 3.0}}


def test_comments_and_order_stay_and_each_old_file_is_kept(tmp_path):
    path = tmp_path / "dataset.toml"
    old = f'{HEAD}# speeds of the log\n[units]\nu = "kn"  # not km/h\n'
    path.write_text(old)
    _, first = write_lines(tmp_path, findings('frame = "ENU"\n[signs]\nv = "port"'))
    _, second = write_lines(tmp_path, findings("[scale]\nu = 1.5"))
    assert first is not None
    assert second is not None
    assert (first.read_text(), first.name, second.name) == (
        old,
        "dataset.toml.before-check",
        "dataset.toml.before-check.2",
    )
    text = path.read_text()
    assert "# speeds of the log" in text
    assert "# not km/h" in text
    assert tomllib.loads(text) == tomllib.loads(old) | {"frame": "ENU", "signs": {"v": "port"}, "scale": {"u": 1.5}}


def test_lines_that_would_spoil_the_file_change_nothing(tmp_path):
    (tmp_path / "dataset.toml").write_text(HEAD)
    with pytest.raises(InputError, match="accepted: a finite number other than 0"):
        write_lines(tmp_path, findings("[scale]\nu = 0.0"))
    assert (tmp_path / "dataset.toml").read_text() == HEAD
    assert len(list(tmp_path.iterdir())) == 1
