"""What a model costs beside its seconds: how many numbers a fit sets."""

from __future__ import annotations

from typing import Any

_NO_PARAMETERS = ("ci95", "scale_")


def count_parameters(model: Any) -> int | None:
    """Numbers that `fit` set in `model`; None where that cannot be told.

    A model may say it itself: `num_parameters`, a number or a method (None: it cannot tell). Of others of ours the
    saved arrays are counted, without intervals, scales of inputs and outputs, and a hybrid's copy of its physics. Torch
    modules held as attributes are counted for any other model.
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
    """Mean number of parameters over the cells of each model, of those that tell it."""
    counts: dict[str, list[int]] = {}
    for summary in summaries:
        if summary.get("parameters") is not None:
            counts.setdefault(summary["model"], []).append(summary["parameters"])
    return {model: sum(found) / len(found) for model, found in counts.items()}
