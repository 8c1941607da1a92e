"""Diagnosis in words, for the terminal and the page."""

from __future__ import annotations

import math
import shlex

import numpy as np

from ...diagnosis.result import Candidate, Cause, Diagnosis, Estimate, Gain, NoiseFloor, Trace, what_it_is
from ...effects.base import EFFECTS, Effect, Parameter
from ...render.table import display_unit

WIDTH = 80
"""Columns of summary.txt."""
DETECTION_LIMIT = 'Detection limit: the smallest effect these runs could have shown ("-": cannot be detected)'
_METRICS = {"ED": "position error"}


def figure(value: float, digits: int = 3) -> str:
    """Number with `digits` significant digits, powers of ten only where it is very small or large."""
    if abs(value) < 1e-12:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{digits}g}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"


def quantity(value: float | None, unit: str) -> str:
    """Value with its unit of display: angles in degrees, forces in kN."""
    if value is None or not math.isfinite(value):
        return "-"
    shown, factor = display_unit(unit)
    return figure(factor * value) + ("" if shown == "1" else f" {shown}")


def interval(e: Estimate) -> str:
    """Text such as `0.31 m/s (95 %: 0.28 to 0.34)`; without interval where there is none."""
    factor = display_unit(e.unit)[1]
    known = all(v is not None and math.isfinite(v) for v in e.ci95)
    if not known and e.unit == "1" and e.value is not None and e.value == round(e.value):
        return f"{e.value:.0f}"  # a choice: the number of a run, a side
    return quantity(e.value, e.unit) + (
        f" (95 %: {figure(factor * e.ci95[0])} to {figure(factor * e.ci95[1])})" if known else ""
    )


def estimate(effect: str, name: str, e: Estimate) -> str:
    """Text of a parameter of an effect: a direction as three digits, a relative change or a share in percent, else its
    value with unit."""
    part = _effect(effect)
    if e.value is None or not math.isfinite(e.value) or part is None:
        return f"{name} {interval(e)}"
    known = all(v is not None and math.isfinite(v) for v in e.ci95)
    if part.vector is not None and name == part.vector[1]:
        return f"{name} {_bearing(e.value)}" + (
            f" (95 %: {_bearing(e.ci95[0])} to {_bearing(e.ci95[1])})" if known else ""
        )
    parameter = _parameter(part, name)
    label = f"{parameter.title} {name}" if parameter is not None and parameter.title else name
    if parameter is not None and parameter.relative:
        return f"{label} {_changed(e.value)}" + (f" (95 %: {_between(*e.ci95, 'smaller', 'larger')})" if known else "")
    if parameter is not None and parameter.share_of:
        doubt = f" (95 %: {100 * e.ci95[0]:.0f} to {100 * e.ci95[1]:.0f} %)" if known else ""
        return f"{label} {100 * e.value:.0f} % of {parameter.share_of}{doubt}"
    return f"{label} {interval(e)}"


def in_words(c: Cause) -> str:
    """Noun phrase of a cause with its size, such as `a current of 0.36 m/s towards 059°`; the effect's name stands
    beside it where it is not in it."""
    part = _effect(c.effect)
    if part is None:
        return c.effect
    sizes = {name: _size(part, name, e) for name, e in c.parameters.items()}
    try:
        words = part.phrase.format_map(sizes) or part.summary
    except KeyError:  # reported under other names, such as root mean squares over runs
        words = part.summary
    return words if all(word in words for word in c.effect.split("_")) else f"{words} ({c.effect})"


def _size(part: Effect, name: str, e: Estimate) -> str:
    """Value alone, with two significant digits; none where its interval holds zero."""
    if e.value is None or not math.isfinite(e.value):
        return "unknown size"
    if part.vector is not None and name == part.vector[1]:
        return _bearing(e.value)
    low, high = e.ci95
    if part.vector is None and low is not None and high is not None and low < 0.0 < high:
        return "an undetermined distance" if e.unit == "m" else "an undetermined size"
    parameter = _parameter(part, name)
    if parameter is not None and parameter.relative:
        return _changed(e.value)
    if parameter is not None and parameter.share_of:
        return f"{100 * e.value:.0f} % of the {parameter.share_of}"
    shown, factor = display_unit(e.unit)
    return f"{figure(float(f'{factor * e.value:.2g}'), 2)}" + ("" if shown == "1" else f" {shown}")


def _parameter(part: Effect, name: str) -> Parameter | None:
    return next((p for p in part.parameters if p.name == name), None)


def _changed(relative: float) -> str:
    return f"{100 * abs(relative):.0f} % {'smaller' if relative < 0 else 'larger'}"


def _between(low: float, high: float, less: str, more: str) -> str:
    """Interval of two relative changes, such as `24 to 79 % less` or `65 % less to 52 % more`."""
    if low < 0 < high:
        return f"{100 * -low:.0f} % {less} to {100 * high:.0f} % {more}"
    near, far = sorted((100 * abs(low), 100 * abs(high)))
    return f"{near:.0f} to {far:.0f} % {less if low < 0 else more}"


def _effect(name: str) -> Effect | None:
    """Effect of this name; None for one that is not installed here."""
    return EFFECTS.get(name) if name in EFFECTS else None


def _bearing(angle: float) -> str:
    """Angle [rad] as a bearing of three digits."""
    return f"{round(math.degrees(angle)) % 360:03d}°"


def added(d: Diagnosis) -> list[Cause]:
    """Causes beyond the ship's own coefficients."""
    return [c for c in d.causes if not _of_ship(c)]


def _of_ship(c: Cause) -> bool:
    effect = _effect(c.effect)
    return effect is not None and effect.traits.search == "hull"


def own_gain(c: Cause, d: Diagnosis) -> Gain | None:
    """Gain of one cause alone: of the ship's own coefficients, or of the only other one; else None."""
    return c.gain if _of_ship(c) else d.gain if len(added(d)) == 1 else None


def gain_words(g: Gain | None, *causes: Cause, whole: str = "the calibrated ship") -> str:
    """Text of the gain of causes together on held-out runs: beside the calibrated ship (`whole`), or of calibrating
    her."""
    if g is None:
        return "The gain on held-out runs was not measured."
    low, high = g.ci95
    all_of_them = "it" if len(causes) == 1 else "both" if len(causes) == 2 else f"all {len(causes)}"
    whose = "" if any(map(_of_ship, causes)) else f" of {whole}"
    doubt = "" if low > 0 else " This may be no gain at all." if high > 0 else " The extended model is worse."
    return (
        f"With {'them' if not whose else all_of_them}, the {_METRICS.get(g.metric, g.metric)}{whose} on held-out runs "
        f"{'falls' if g.relative >= 0 else 'rises'} from "
        f"{figure(g.before)} m to {figure(g.after)} m: {gain_share(g)}.{doubt}"
    )


def gain_share(g: Gain) -> str:
    """Text of the relative gain with its interval and the number of runs that are better."""
    low, high = g.ci95
    between = (
        _between(-high, -low, "less", "more")
        if low <= 0 <= high
        else "{:.0f} to {:.0f} %".format(*sorted((100 * abs(low), 100 * abs(high))))
    )
    share = f"{100 * abs(g.relative):.0f} % {'less' if g.relative >= 0 else 'more'}"
    return f"{share} (95 %: {between}), better in {g.runs_better.replace('/', ' of ')} runs"


def headline(d: Diagnosis) -> str:
    """Verdict in one or two sentences."""
    if d.verdict == "found":
        *first, last = map(in_words, d.causes)
        found = f"{', '.join(first)}, and {last}" if first else last
        if not added(d):
            return f"Found: only {found}."
        if d.simulation and d.gain is not None:  # its errors stand beside each other in `calibration_words`
            return f"Found: {found}."
        return f"Found: {found}. {gain_words(d.gain, *added(d), whole=baseline(d))}"
    if d.verdict == "unknown" and d.unknown:
        return (
            f"The model lacks something that is not in the library: {what_it_is(d.unknown)}. "
            f"The log Bayes factor is {0.5 * d.unknown['score']:.0f}. No effect of the library explains as much."
        )
    if d.warnings:
        return (
            "No cause is identified. The warnings below give the reason. The detection limits state what these "
            "runs could have shown."
        )
    return (
        "Nothing found beyond the ship's own coefficients: no effect of the library and no unexplained "
        "dependence. "
        "The detection limits state what these runs could have shown."
    )


def calibration_words(d: Diagnosis) -> str:
    """Errors of the ship file's model and of the calibrated one; "" where they were not computed."""
    if d.calibration is None:
        return ""
    c = d.calibration
    where = "held-out runs" if c.held_out else "the runs that were fitted"
    model = f"your simulation {d.simulation}" if d.simulation else "the ship file's model"
    return (
        f"In open-loop rollouts of at most {c.seconds:.0f} s on {where}, {model} is {figure(c.before)} m off on average"
        f". With the ship's own coefficients {'corrected' if d.simulation else 'calibrated'} it is {figure(c.after)} m"
        f" off (95 %: {figure(c.ci95[0], 2)} to {figure(c.ci95[1], 2)} m)."
        + (_with_causes(d) if d.simulation else "")
        + (f" {d.stand_in}" if d.stand_in else "")
        + (f" {floor_words(c.noise_floor)}" if c.noise_floor is not None else "")
        + "".join(
            f" The {'' if d.simulation else 'calibrated '}ship's {m.coefficient} is {_changed(m.change)} than "
            f"{'your simulation' if d.simulation else 'the ship file'}'s "
            f"(95 %: {_between(*m.ci95, 'smaller', 'larger')})."
            for m in c.moved
        )
    )


def floor_words(floor: NoiseFloor) -> str:
    """Errors that the noise of the sensors alone makes in these rollouts."""
    return (
        f"The noise of the sensors alone makes {figure(floor.position, 2)} m and "
        f"{figure(math.degrees(floor.heading), 2)}° of heading (noise floor)."
    )


def _with_causes(d: Diagnosis) -> str:
    """Error of a simulation with the causes, on held-out runs."""
    if d.gain is None or not added(d):
        return ""
    low, high = d.gain.after_ci95
    named = " and ".join(in_words(c) for c in added(d))
    return f" With {named} as well it is {figure(d.gain.after)} m off (95 %: {figure(low, 2)} to {figure(high, 2)} m)."


def baseline(d: Diagnosis) -> str:
    """Words for the model beside which the causes are judged."""
    return "your simulation with the ship's own coefficients" if d.simulation else "the calibrated ship"


def drawn(d: Diagnosis) -> tuple[str, str]:
    """Names of the two models whose predictions are drawn."""
    return ("your simulation", "corrected simulation") if d.simulation else ("calibrated ship", "extended model")


def next_command(d: Diagnosis) -> str:
    """Command that compares `physics` or the simulation, the calibrated ship and the proposed model on held-out runs,
    over as long as the diagnosis rolled them out; "" where nothing else is proposed."""
    if d.extended_model in ("physics", d.simulation):
        return ""
    first = [d.simulation] if d.simulation else ["physics", d.extended_model.split("+")[0]]
    models = dict.fromkeys([*first, d.extended_model])
    named = " ".join(f"--model {shlex.quote(m)}" for m in models)
    over = "" if d.trace is None else f" --horizon {_rolled_out(d.trace):g}"
    return f"shipbench run {named} --dataset {shlex.quote(d.spec or d.dataset)}{over}"


def _rolled_out(trace: Trace) -> float:
    """Time [s] that at least half of the runs were rolled out for: `run` leaves out those shorter than its horizon."""
    known = np.isfinite(trace.measured).any(axis=-1)
    lasted = np.where(known, trace.t, 0.0).max(axis=1)  # of every segment
    longest = np.zeros(len(trace.names))
    np.maximum.at(longest, trace.run, lasted)
    return float(np.quantile(longest, 0.5, method="lower"))


def detectable(c: Candidate) -> str:
    """Detection limit per amplitude, the unit once where it is the same; "-" where no possible size would."""
    known = [(name, v, _unit(c, name)) for name, v in c.detectable.items() if v is not None and math.isfinite(v)]
    parts = []
    for i, (name, v, unit) in enumerate(known):
        follows = i + 1 < len(known) and known[i + 1][2] == unit
        parts.append(f"{name} {figure(display_unit(unit)[1] * v) if follows else quantity(v, unit)}")
    return ", ".join(parts) or "-"


def _unit(c: Candidate, name: str) -> str:
    """Unit of a parameter; components of a vector have the unit of its size."""
    if name in c.units:
        return c.units[name]
    return next((u for u in c.units.values() if u != "rad"), "1")


def grade(score: float) -> str:
    """Strength of the evidence of a score (twice the log Bayes factor) in the words of Kass and Raftery (1995), Bayes
    factors, section 3.2."""
    factor = 0.5 * score
    word = "very strong" if factor > 5.0 else "strong" if factor > 3.0 else "positive" if factor > 1.0 else "weak"
    return f"{word} evidence"


def strength(c: Cause) -> str:
    """Text of the evidence in words with the log Bayes factor."""
    if not math.isfinite(c.score):
        return "an error of the record itself"
    return f"{grade(c.score)} (log Bayes factor {0.5 * c.score:.0f})" + (
        f", supported by {c.support}" if c.support else ""
    )


def force_words(force: dict[str, float]) -> str:
    """Text of the greatest forces, such as `up to 38.0 kN sideways and 1.20 MN m in yaw on these runs`; empty where
    there are none."""
    places = (("surge", "N", "lengthwise"), ("sway", "N", "sideways"), ("yaw", "N m", "in yaw"))
    parts = [f"{_newtons(force[axis], unit)} {place}" for axis, unit, place in places if axis in force]
    *first, last = parts or [""]
    return (
        f"up to {', '.join(first)} and {last} on these runs" if first else f"up to {last} on these runs" if last else ""
    )


def _newtons(value: float, unit: str) -> str:
    """Text of two significant digits with the prefix that suits the size."""
    rounded = float(f"{value:.2g}")
    factor, prefix = (1e-6, "M") if rounded >= 1e6 else (1e-3, "k") if rounded >= 1e3 else (1.0, "")
    return f"{figure(factor * rounded, 2)} {prefix}{unit}"


def cause_texts(c: Cause, alone: Gain | None = None) -> list[str]:
    """Texts on a cause besides its sizes: force, evidence, its gain alone, causes it is confounded with, correction."""
    force = force_words(c.force)
    texts = [f"Its force is {force}."] if force else []
    texts.append(f"{strength(c)[0].upper()}{strength(c)[1:]}.")
    texts += [c.evidence.rstrip(".") + "."] if c.evidence else []
    if alone is not None and alone.ci95[0] > 0.0:
        removed = (
            f"{figure(alone.before - alone.after)} m of {figure(alone.before)} m "
            f"{_METRICS.get(alone.metric, alone.metric)}"
        )
        texts.append(f"Naming it removes {removed} on held-out runs.")
    if c.confused_with:
        texts.append(f"These data cannot separate it from {', '.join(c.confused_with)}.")
        texts += [f"A trial that can: {c.separating_manoeuvre.rstrip('.')}."] if c.separating_manoeuvre else []
    return texts + ([f"To correct the record, write in dataset.toml: {c.correction}"] if c.correction else [])
