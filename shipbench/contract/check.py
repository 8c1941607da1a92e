"""Check of a model against every rule of the contract, in seconds."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..names import brief
from ..predictors.base import make_predictor
from ..records import Dataset
from ..registry import reason
from ..replay.bind import bound
from ..signals import COMMANDS
from ..specs import spec_of
from .base import BROKEN, NOT_APPLICABLE, PASSED, Rule, Verdict
from .rules import RULES
from .small import few_windows, small_harbour
from .subject import Broken, NotApplicable, Subject


@dataclass(frozen=True)
class Report:
    """Result of a check."""

    model: str
    data: str
    seconds: float
    verdicts: tuple[Verdict, ...]

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(self.of(status))} {status}" for status in (PASSED, BROKEN, NOT_APPLICABLE))
        broken = (f"  {v.rule}: {v.evidence}" for v in self.of(BROKEN))
        return brief("\n".join([f"Check of {self.model} on {self.data}: {counts}", *broken]))

    def of(self, status: str) -> list[Verdict]:
        """Verdicts with that status."""
        return [v for v in self.verdicts if v.status == status]

    def document(self) -> dict[str, Any]:
        """Report as one JSON document."""
        return {
            "model": self.model, "data": self.data, "seconds": round(self.seconds, 2),
            "passed": len(self.of(PASSED)), "broken": len(self.of(BROKEN)),
            "not_applicable": len(self.of(NOT_APPLICABLE)),
            "rules": [{"rule": v.rule, "says": v.says, "status": v.status,
                    "evidence": v.evidence} for v in self.verdicts],
        }  # fmt: skip


def check_model(model: Any, data: Dataset | None = None, device: str | None = None) -> Report:
    """Check a model against the contract.

    Args:
        model: a spec (name, name[key=value], path.py:Class, saved folder), or a class or object in memory.
        data: where to check it (a few windows are used); small simulated port manoeuvres by default.
        device: where the model computes, if it has a device and the spec names none (see `check_device`).

    Raises:
        InputError: the spec cannot be made into a model, the model refuses the data (`skip`), its inputs are not those
            of the data, or no such device is here.
    """
    began = time.perf_counter()
    spec = spec_of(model)
    text = spec.text
    try:
        model = make_predictor(spec, device)
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # a stranger's file is imported here
        raise InputError(f"model '{text}' cannot be made: {reason(error).rstrip('.')}. Correct its file.") from error
    for method in ("fit", "predict"):
        if not callable(getattr(model, method, None)):
            raise InputError(
                f"model '{text}' has no method {method}; a predictor has fit(train, valid=None, *, seed) and "
                "predict(s0, U, history=None)."
            )
    inputs = tuple(getattr(model, "inputs", COMMANDS)) if spec.saved else COMMANDS
    if getattr(model, "replay", False):
        if data is None:
            raise InputError(f"model '{text}' belongs to recorded runs. Accepted: their data set, with -d DATASET.")
        spec = bound(spec, data)
        model = make_predictor(spec, device)
    used = small_harbour(inputs=inputs) if data is None else few_windows(data, getattr(model, "skip_windows", None))
    if inputs != used.inputs and spec.saved:
        raise InputError(
            f"the saved model uses the inputs {', '.join(inputs)}; data set '{used.name}' has "
            f"{', '.join(used.inputs)}. Give its own data."
        )
    refusal = getattr(model, "skip", None)
    if callable(refusal) and (why := refusal(used)):
        raise InputError(f"model '{text}' cannot be checked here: {why}.")
    return check_subject(Subject(spec, used, device), began)


def check_subject(subject: Subject, began: float | None = None) -> Report:
    """Test every rule on a model with the subject's data."""
    began = time.perf_counter() if began is None else began
    verdicts: dict[str, Verdict] = {}
    for rule in RULES:
        verdicts[rule.name] = _try(rule, subject, [verdicts[name] for name in rule.after])
    data = subject.data
    about = f"{data.name}, {len(data)} runs of {len(data.runs[0]) - 1} steps of {data.dt:g} s"
    return Report(subject.spec.text, about, time.perf_counter() - began, tuple(verdicts.values()))


def _try(rule: Rule, subject: Subject, before: list[Verdict]) -> Verdict:
    """Verdict on one rule."""
    missing = [v.rule for v in before if v.status == BROKEN]
    if missing:
        evidence = f"not tried: the rule '{missing[0]}' is broken"
        return Verdict(rule.name, rule.says, NOT_APPLICABLE, evidence, tried=False)
    try:
        return Verdict(rule.name, rule.says, PASSED, rule.tries(subject))
    except NotApplicable as why:
        return Verdict(rule.name, rule.says, NOT_APPLICABLE, str(why))
    except Broken as evidence:
        return Verdict(rule.name, rule.says, BROKEN, str(evidence))
    except (Exception, SystemExit) as error:  # a stranger's model may raise anything, anywhere
        return Verdict(rule.name, rule.says, BROKEN, f"raised {reason(error)}")
