"""Registry of all checks, one file each. A file's `CHECK` takes a `Recording` and returns its findings."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from ..records import Dataset
from ..registry import Registry
from ..signals import STATES
from ..steps import step
from .finding import SEVERITIES, Finding
from .gross import correct as correct_gross
from .held import correct_held
from .north import correct_north
from .placeholders import correct_placeholders
from .reading import read_recording
from .recording import Recording

_HELPERS = frozenset({
    "applying", "base", "finding", "gross", "held", "north", "placeholders", "reading", "recording", "rudder_side",
    "selection", "statistics",
    "thresholds", "track", "units", "wind_reading",
})  # fmt: skip
CHECKS = Registry("check", "checking", "CHECK", helpers=_HELPERS, group="checks")


@lru_cache(maxsize=1)
def _checks() -> tuple[Callable[[Recording], list[Finding]], ...]:
    return tuple(CHECKS.get(name) for name in CHECKS.names())  # looks for entry points, which takes as long as a check


def check_recording(recording: Recording) -> list[Finding]:
    """Findings of the gross checks, then those of every other check on the data with the gross errors corrected; errors
    first.

    None concerns a channel that import derived from others: it has no error of its own.
    """
    corrected, found = recording, []
    corrections = (correct_placeholders, correct_north, correct_held, correct_gross)
    checks = _checks()
    total = len(corrections) + len(checks)
    for number, correct in enumerate(corrections):
        step("look for gross errors", number / total, (number + 1) / total)
        corrected, more = correct(corrected)
        found += more
    for number, check in enumerate(checks, len(corrections)):
        step(f"check {number - len(corrections) + 1} of {len(checks)}", number / total, (number + 1) / total)
        found += check(corrected)
    found = [f for f in found if not f.channels or not set(f.channels) <= set(recording.dataset.derived)]
    found = _without_consequences(found)
    if recording.wrapped:
        found.append(_wrapped(recording))
    return sorted(found, key=lambda f: SEVERITIES.index(f.severity))


def _without_consequences(found: list[Finding]) -> list[Finding]:
    """Remove findings that follow from others, so that each fault is reported once.

    Velocities or a yaw rate that are late against the other motion are also late against rudder and shaft; a stuck
    rudder seems late. Under a speed-log dropout the track identifies nothing else; a meaningless yaw rate says nothing
    on the rudder.
    """
    if any(f.kind == "speed-log dropout" for f in found):
        found = [f for f in found if f.check not in ("track", "spikes") or not set(f.channels) <= {"x", "y", "u", "v"}]
    if any(f.kind == "unrelated" for f in found):
        found = [f for f in found if f.check != "response" or "r" not in f.channels]
    known = {
        c
        for f in found
        if (f.kind, f.check) in (("lag", "track"), ("lag", "yaw"), ("frozen", "samples"))
        for c in f.channels
    }
    return [f for f in found if f.check != "response" or not known & {c.removesuffix("_c") for c in f.channels}]


def _wrapped(recording: Recording) -> Finding:
    names, total = recording.wrapped, len(set(recording.parent.values())) or len(recording.runs)
    text = (
        f"the heading is wrapped (it jumps by a whole turn) in {len(names)} of {total} runs; it is made "
        "continuous on loading."
    )
    return Finding("reading", "note", "wrapped heading", text, todo="Nothing.", channels=("psi",), runs=names)


def check_dataset(dataset: Dataset) -> list[Finding]:
    """Findings on a data set in memory.

    Args:
        dataset: as loaded or made; all its actuators and commands count as recorded.
    """
    return check_recording(Recording(dataset, recorded=frozenset((*STATES, *dataset.inputs))))


def check_path(spec: str) -> tuple[Recording, list[Finding]]:
    """Recording of a registered data set or a folder, as far as it can be read, and all findings on it.

    Raises:
        InputError: neither a known name nor a folder, or nothing in it can be read.
    """
    recording, found = read_recording(spec)
    found += check_recording(recording)
    return recording, sorted(found, key=lambda f: SEVERITIES.index(f.severity))
