"""What a rule and a verdict are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .subject import Subject

PASSED, BROKEN, NOT_APPLICABLE = "passed", "broken", "not applicable"


@dataclass(frozen=True)
class Rule:
    """One sentence of the contract with the function that tries it.

    Args:
        name: short and stable; what `--json` reports.
        says: the rule, in one sentence.
        tries: returns the evidence that it is kept, or raises `Broken` or `NotApplicable`; anything else that it raises
            is the model's failure.
        after: rules without which this one means nothing: where one of them is broken, this one is not put to the
            model.
    """

    name: str
    says: str
    tries: Callable[[Subject], str]
    after: tuple[str, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """What came of a rule: `status` is PASSED, BROKEN or NOT_APPLICABLE; `evidence` are figures or the reason."""

    rule: str
    says: str
    status: str
    evidence: str
