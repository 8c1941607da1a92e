"""Cost of a model beside its run time: number of fitted parameters."""

from __future__ import annotations

from typing import Any

_NO_PARAMETERS = ("ci95", "scale_")


def count_parameters(model: Any) -> int | None:
    """Count of the numbers that `fit` set in `model`; None where it is unknown.

    A model may state it: `num_parameters`, a number or a method (None: unknown). For other models of shipbench the
    saved arrays are counted, without intervals, scales of inputs and outputs, and a hybrid's copy of its physics. For
    any other model torch modules held as attributes are counted.
    """
    try:
        return _count(model)
    except Exception:  # a user's own model; its scores are good all the same
        return None


def _count(model: Any) -> int | None:
    if hasattr(model, "num_parameters"):
        said = model.num_parameters() if callable(model.num_parameters) else model.num_parameters
        return None if said is None else int(said)
    arrays = getattr(model, "_arrays", None)
    if callable(arrays):
        found = arrays()
        counted = [n for n in found if not any(word in n for word in _NO_PARAMETERS) and f"physics.{n}" not in found]
        return sum(int(found[n].size) for n in counted)
    modules = [
        value for value in getattr(model, "__dict__", {}).values() if callable(getattr(value, "named_parameters", None))
    ]
    return sum(p.numel() for module in modules for p in module.parameters()) if modules else None


def parameters_by_model(summaries: list[dict[str, Any]]) -> dict[str, float]:
    """Mean number of parameters over the cells of each model, of those that state it."""
    counts: dict[str, list[int]] = {}
    for summary in summaries:
        if summary.get("parameters") is not None:
            counts.setdefault(summary["model"], []).append(summary["parameters"])
    return {model: sum(found) / len(found) for model, found in counts.items()}
