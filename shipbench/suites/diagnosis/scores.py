"""Figures of the diagnosis suite from its rows: rates with Wilson intervals beside the targets, and confusions of
causes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ...effects.base import EFFECTS
from .unmodelled import canonical

Row = dict[str, Any]
HULL = "hull_derivatives"

CLASSES = (
    {"current", "current_per_run"}, {"wind", "wind_per_run"}, {"rudder_delay", "rudder_lag"},
    {"rudder_lag", "rudder_rate_limit"},
    {"rudder_deadband", "rudder_backlash"}, {"shaft_lag", "shaft_rate_limit"}, {"propeller_walk", "list"},
    {"propeller_walk", "rudder_offset"},
    {"cross_flow_drag", "hull_derivatives"}, {"shallow_water", "hull_derivatives"}, {"rudder_gain", "race_gain"},
)  # fmt: skip
"""Pairs declared equal before any result: one is a special case of the other, or their forces have one form in ordinary
manoeuvres."""

NOT_COMPARABLE = frozenset(
    {"hull_derivatives", "race_gain", "wake_variation", "thruster_speed_loss", "cross_flow_drag", "rudder_gain"}
)
"""Effects whose hidden size is not the missing size: the fitted model's own hull, race, wake, thrusters and rudder lift
differ from the simulator's."""

TARGETS = {
    "first-named cause right, 1x": (0.90, 1), "first-named cause right, 0.3x": (0.65, 1), "right class, 1x": (0.95, 1),
    "right class, 0.3x": (0.75, 1),
    "two effects, exact pair": (0.75, 1), "false alarms, same structure": (0.05, -1),
    "false alarms, other structure": (0.10, -1),
    "outside: unknown and right variable": (0.75, 1), "size: median relative error": (0.15, -1),
    "size: coverage of the 95 % intervals": (0.90, 1),
    "share of the oracle's gain": (0.90, 1), "seconds: share within 60 s": (1.0, 1),
}  # fmt: skip
"""Target value and its sense: 1 at least, -1 at most. Coverage must also stay below 0.97."""


def wilson(hits: int, total: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a rate."""
    if total == 0:
        return math.nan, math.nan
    z, p = 1.959964, hits / total
    middle, half = p + z * z / (2 * total), z * math.sqrt(p * (1 - p) / total + z * z / (4 * total * total))
    return (middle - half) / (1 + z * z / total), (middle + half) / (1 + z * z / total)


def ok(row: Row) -> bool:
    """Whether the case was diagnosed without an error."""
    return row["status"] == "ok"


def named(row: Row, skip_hull: bool = False) -> list[str]:
    """Causes in their order; without `hull_derivatives` where that was not hidden and `skip_hull`."""
    causes = row.get("named") or []
    return [c for c in causes if not (skip_hull and c == HULL and HULL not in row["truth"])]


def first(row: Row, skip_hull: bool = False) -> str:
    """First identified cause, else the verdict."""
    causes = named(row, skip_hull)
    return (
        causes[0] if causes else ("failed" if not ok(row) else "none" if row["verdict"] == "found" else row["verdict"])
    )


def right(row: Row, skip_hull: bool = False) -> bool:
    """Whether the first identified cause is a true one."""
    return first(row, skip_hull) in row.get("truth", ())


def right_class(row: Row, skip_hull: bool = False) -> bool:
    """Whether the cause is right, reported as confounded with the truth, or declared equal to it."""
    if right(row, skip_hull):
        return True
    cause = first(row, skip_hull)
    said = set(row.get("confused", {}).get(cause, ()))
    return any(t in said or {cause, t} in CLASSES for t in row.get("truth", ()))


def exact_pair(row: Row, skip_hull: bool = True) -> bool:
    """Whether the identified causes are exactly the true ones."""
    return ok(row) and set(named(row, skip_hull)) == set(row["truth"])


def alarm(row: Row, skip_hull: bool = False) -> bool:
    """Whether a cause is identified, or one outside the library is claimed; a failed case counts as an alarm."""
    return not ok(row) or bool(named(row, skip_hull)) or row["verdict"] == "unknown"


def says_unknown(row: Row) -> bool:
    """Whether the verdict is `unknown`."""
    return ok(row) and row["verdict"] == "unknown"


def right_variable(row: Row) -> bool:
    """Whether the verdict is `unknown`, with one of the variables on which the force depends."""
    if not says_unknown(row):
        return False
    told = row.get("unknown") or {}
    text = " ".join(str(told.get(key, "")) for key in ("variable", "variables", "depends_on"))
    return bool(canonical(text) & set(row["variables"]))


def right_change(row: Row) -> bool:
    """Whether the verdict is `change_point`, with the changed effect in the cause or its evidence, and the run within
    one."""
    if not right(row, True):
        return False
    estimates = row["estimates"].get("change_point", {})
    text = f"{row['evidence'].get('change_point', '')} {' '.join(estimates)}"
    runs = [value[0] for key, value in estimates.items() if "run" in key and value[0] is not None]
    return row["detail"]["changed"] in text and any(abs(r - row["detail"]["from_run"]) <= 1 for r in runs)


def size_errors(rows: Iterable[Row], comparable: bool = True) -> tuple[list[float], list[bool]]:
    """Relative errors and coverages of the sizes of all hidden effects that were identified; no directions, no shape
    parameters."""
    errors, covered = [], []
    for row in rows:
        for effect, values in zip(row.get("truth", ()), row.get("values", ()), strict=False):
            if comparable and effect in NOT_COMPARABLE:
                continue
            part = EFFECTS.get(effect)
            skip = {p.name for p in part.parameters if p.shape} | ({part.vector[1]} if part.vector else set())
            for name, (value, low, high) in row.get("estimates", {}).get(effect, {}).items():
                if name in skip or name not in values or value is None or not values[name]:
                    continue
                errors.append(abs(value - values[name]) / abs(values[name]))
                if low is not None and high is not None:
                    covered.append(low <= values[name] <= high)
    return errors, covered


def rate(figure: str, rows: Sequence[Row], hit: Callable[[Row], bool], note: str = "") -> Row:
    """Line of the table of figures."""
    hits = sum(hit(row) for row in rows)
    low, high = wilson(hits, len(rows))
    return _line(figure, hits / len(rows) if rows else math.nan, low, high, len(rows), note)


def _line(figure: str, value: float, low: float, high: float, total: int, note: str = "") -> Row:
    target, sense = TARGETS.get(figure, (math.nan, 0))
    met = "" if not sense or math.isnan(value) else "yes" if sense * (value - target) >= 0 else "no"
    if figure.startswith("size: coverage") and met == "yes" and value > 0.97:
        met = "no"
    text = (
        ""
        if not sense
        else f"{'>=' if sense > 0 else '<='} {target:g}"
        + (" and <= 0.97" if figure.startswith("size: coverage") else "")
    )
    return {
        "figure": figure,
        "value": value,
        "low": low,
        "high": high,
        "n": total,
        "target": text,
        "met": met,
        "note": note,
    }


def figures(rows: Sequence[Row]) -> list[Row]:
    """Lines of all target figures, then the same with other counting rules."""
    kinds = {kind: [r for r in rows if r["kind"] == kind] for kind in {r["kind"] for r in rows}}
    by_size = {size: [r for r in kinds.get("single", []) if r.get("size") == [size]] for size in (1.0, 0.3)}
    same, other, pairs = (kinds.get(k, []) for k in ("none-same", "none-other", "pair"))
    lines = []
    for label, part in (("1x", by_size[1.0]), ("0.3x", by_size[0.3])):
        lines.append(
            rate(f"first-named cause right, {label}", part, lambda r: right(r, True), "hull_derivatives skipped")
        )
        lines.append(rate(f"right class, {label}", part, lambda r: right_class(r, True), "hull_derivatives skipped"))
    lines.append(rate("two effects, exact pair", pairs, exact_pair, "hull_derivatives skipped"))
    lines.append(rate("false alarms, same structure", same, lambda r: alarm(r, True), "hull_derivatives not counted"))
    lines.append(rate("false alarms, other structure", other, lambda r: alarm(r, True), "hull_derivatives not counted"))
    lines.append(rate("outside: unknown and right variable", kinds.get("outside", []), right_variable))
    hit = [r for r in kinds.get("single", []) if right(r, True)]
    errors, covered = size_errors(hit)
    median = float(np.median(errors)) if errors else math.nan
    lines.append(_line("size: median relative error", median, math.nan, math.nan, len(errors)))
    lines.append(
        rate("size: coverage of the 95 % intervals", [{"covered": c} for c in covered], lambda r: r["covered"])
    )
    lines.append(oracle_share([*kinds.get("single", []), *pairs]))
    done = [r for r in rows if ok(r)]
    seconds = [r["seconds"] for r in done]
    lines.append(
        rate(
            "seconds: share within 60 s",
            done,
            lambda r: r["seconds"] <= 60.0,
            f"median {np.median(seconds):.0f} s" if seconds else "",
        )
    )
    for label, part in (("1x", by_size[1.0]), ("0.3x", by_size[0.3])):
        lines.append(rate(f"first of all causes right, {label}", part, right, "hull_derivatives counted"))
        lines.append(rate(f"right class of all causes, {label}", part, right_class, "hull_derivatives counted"))
        lines.append(
            rate(
                f"anything found beside the hull, {label}", part, lambda r: ok(r) and alarm(r, True), "detection power"
            )
        )
        lines.append(
            rate(
                f"true cause among those named, {label}", part, lambda r: bool(set(named(r)) & set(r.get("truth", ())))
            )
        )
        lines.append(oracle_power(f"oracle test detects it, {label}", part))
    lines.append(
        rate("two effects, exact pair, hull counted", pairs, lambda r: exact_pair(r, False), "hull_derivatives counted")
    )
    lines.append(
        rate("two effects, both among those named", pairs, lambda r: set(r.get("truth", ("?",))) <= set(named(r)))
    )
    lines.append(oracle_power("oracle test detects both of two", pairs))
    lines.append(rate("two effects, one at least", pairs, lambda r: bool(set(r.get("truth", ())) & set(named(r)))))
    lines.append(
        rate(
            "false alarms with the hull, same structure",
            same,
            alarm,
            "its hull differs by N(0, 0.2): naming it is right",
        )
    )
    lines.append(
        rate("false alarms with the hull, other structure", other, alarm, "its hull truly differs: naming it is right")
    )
    published, calm = kinds.get("published", []), kinds.get("none-published", [])
    lines.append(
        rate("first-named cause right, ships of the literature", published, lambda r: right(r, True), "typical size")
    )
    lines.append(
        rate("right class, ships of the literature", published, lambda r: right_class(r, True), "typical size")
    )
    lines.append(
        rate(
            "nothing hidden, a wrong name, ships of the literature",
            calm,
            lambda r: bool(named(r, True)),
            "hull_derivatives skipped",
        )
    )
    lines.append(
        rate(
            "nothing hidden, unknown, ships of the literature",
            calm,
            says_unknown,
            "the fit leaves what is ordinary, or a force is missing",
        )
    )
    lines.append(rate("outside: says unknown", kinds.get("outside", []), says_unknown))
    lines.append(rate("outside: a wrong name", kinds.get("outside", []), lambda r: bool(named(r, True))))
    lines.append(rate("change_point named", kinds.get("change", []), lambda r: right(r, True)))
    lines.append(rate("change_point with effect and run", kinds.get("change", []), right_change))
    lines.append(rate("unit_or_sign_error named", kinds.get("unit", []), lambda r: right(r, True)))
    return [line for line in lines if line["n"]]


def oracle_share(rows: Sequence[Row]) -> Row:
    """Mean gain over the mean gain of the oracle's model, where that gains 2 % or more."""
    both = [(r.get("gain") or 0.0, r["oracle_gain"]) for r in rows if ok(r) and (r.get("oracle_gain") or 0.0) >= 0.02]
    value = sum(g for g, _ in both) / sum(o for _, o in both) if both else math.nan
    return _line(
        "share of the oracle's gain", value, math.nan, math.nan, len(both), "where the oracle gains 2 % or more"
    )


def oracle_power(figure: str, rows: Sequence[Row]) -> Row:
    """Mean power of the likelihood-ratio test with known effect, size, noise and nuisance parameters, at 5 % false
    alarms of its own."""
    powers = [r["bound"] for r in rows if ok(r) and r.get("bound") is not None]
    value = float(np.mean(powers)) if powers else math.nan
    return _line(
        figure, value, math.nan, math.nan, len(powers), "likelihood ratio, 5 % false alarms for this effect alone"
    )


def per_effect(rows: Sequence[Row]) -> list[Row]:
    """Lines, one per hidden effect: right at both sizes, confusions, size error and coverage."""
    table = []
    singles = [r for r in rows if r["kind"] == "single" and r.get("truth")]
    for effect in sorted({r["truth"][0] for r in singles}):
        own = [r for r in singles if r["truth"] == [effect]]
        line: Row = {"effect": effect}
        for label, size in (("1", 1.0), ("0.3", 0.3)):
            part = [r for r in own if r["size"] == [size]]
            line[f"right_{label}"] = f"{sum(right(r, True) for r in part)}/{len(part)}"
            line[f"class_{label}"] = f"{sum(right_class(r, True) for r in part)}/{len(part)}"
        wrong = Counter(first(r, True) for r in own if not right(r, True))
        errors, covered = size_errors([r for r in own if right(r, True)], comparable=False)
        line["oracle"] = " / ".join(
            f"{oracle_power('', [r for r in own if r['size'] == [size]])['value']:.2f}" for size in (1.0, 0.3)
        )
        line["instead"] = ", ".join(f"{name} {n}" for name, n in wrong.most_common(4))
        line["error"] = float(np.median(errors)) if errors else math.nan
        line["covered"] = f"{sum(covered)}/{len(covered)}" if covered else "-"
        line["note"] = "size not comparable" if effect in NOT_COMPARABLE else ""
        table.append(line)
    return table


def confusion(rows: Sequence[Row]) -> list[Row]:
    """Table of the true effect against the first identified one (hull skipped), with the causes of the other kinds
    under their own names."""
    counts: Counter[tuple[str, str, str]] = Counter()
    for row in rows:
        if row["kind"] != "pair":
            detail = row.get("detail", {})
            hidden = detail.get("name") or detail.get("changed") or "".join(row.get("truth", ())) or "nothing"
            counts[row["kind"], hidden, first(row, True)] += 1
    return [
        {"kind": k, "hidden": h, "named": n, "count": c}
        for (k, h, n), c in sorted(counts.items(), key=lambda i: (i[0][:2], -i[1], i[0][2]))
    ]


def baseline_lines(rows: Sequence[Row]) -> list[Row]:
    """Lines of first cause right, exact pairs and false alarms, for the diagnosis and both baselines, on the same data
    sets."""
    done = [r for r in rows if ok(r) and r.get("baselines")]
    if not done:
        return []

    def share(part: Sequence[Row], hit: Callable[[Row], bool]) -> float:
        return sum(map(hit, part)) / len(part) if part else math.nan

    table = []
    for method in ("diagnosis", *done[0]["baselines"]):

        def of(row: Row, method: str = method) -> list[str]:
            return named(row, True) if method == "diagnosis" else row["baselines"][method]["named"]

        line: Row = {"method": method}
        for label, size in (("1", 1.0), ("0.3", 0.3)):
            part = [r for r in done if r["kind"] == "single" and r["size"] == [size]]
            line[f"right_{label}"] = share(part, lambda r: of(r)[:1] == r["truth"])
        line["pair"] = share([r for r in done if r["kind"] == "pair"], lambda r: set(of(r)) == set(r["truth"]))
        for kind in ("none-same", "none-other"):
            line[kind] = share([r for r in done if r["kind"] == kind], lambda r: bool(of(r)))
        table.append(line)
    return table
