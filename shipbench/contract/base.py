"""Rules and verdicts of the contract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .subject import Subject

PASSED, BROKEN, NOT_APPLICABLE = "passed", "broken", "not applicable"


@dataclass(frozen=True)
class Rule:
    """Rule of the contract in one sentence, with the function that tests it.

    Args:
        name: short and stable; reported by `--json`.
        says: the rule, in one sentence.
        tries: returns the evidence that it is kept, or raises `Broken` or `NotApplicable`; any other exception is the
            model's failure.
        after: rules that must hold before this one can be tested: where one of them is broken, this one is skipped.
    """

    name: str
    says: str
    tries: Callable[[Subject], str]
    after: tuple[str, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """Result of a rule: `status` is PASSED, BROKEN or NOT_APPLICABLE; `evidence` are figures or the reason. `tried` is
    False where a rule before it is broken."""

    rule: str
    says: str
    status: str
    evidence: str
    tried: bool = True
