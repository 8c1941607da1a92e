"""Head of a column, such as "Ruderwinkel [°]": the channel that it names, its qualifiers, and its unit.

The words stand in heads.csv and units.csv, one a row, in English, German, French, Spanish and Norwegian.
"""

from __future__ import annotations

import csv
import re
import unicodedata
from dataclasses import dataclass
from functools import cache
from importlib import resources

from ..entries import CHANNELS, unit_of
from ..thresholds import THRESHOLDS

QUANTITIES = {"m": "length", "m/s": "speed", "rad": "angle", "rad/s": "rate", "rpm": "shaft", "N": "force"}
"""Quantity in units.csv for each standard unit."""
_LETTERS = str.maketrans(
    {"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "œ": "oe", "Œ": "Oe", "ß": "ss", "º": "°", "µ": "u", "μ": "u"}
)
_BRACKETS = r"[\[({<]([^\])}>]*)[\])}>]"
_SIDE_LETTERS = {"p", "l", "r", "a", "b"}
_SHORT = THRESHOLDS.count("short_word")
"""Letters of the longest word that names a channel only where it stands alone: the r of 'r_max' is no yaw rate."""


@dataclass(frozen=True)
class Head:
    """Meaning of a column's head.

    `meaning` is a channel or another word of heads.csv's first column, None where none or several are named;
    `qualifiers` are those with a "+"; `sure` says that no word is left over. `unit` is the text of the unit and `units`
    maps the quantities that it can be of to the unit's name.
    """

    name: str
    meaning: str | None
    qualifiers: frozenset[str]
    sure: bool
    unit: str
    units: dict[str, str]
    base: tuple[str, ...] = ()

    @property
    def channel(self) -> str | None:
        """Standard channel that is named, with its qualifiers; None where it is none."""
        name, marks = self.meaning, self.qualifiers
        if name is None or "+other" in marks:
            return None
        name = {"psi magnetic": "psi"}.get(name, name)
        if "+apparent" in marks:
            name = {"wind_speed": "apparent_wind_speed", "wind_from": "apparent_wind_from"}.get(name, name)
        if "+order" in marks:
            name = f"{name}_c"
        return name if name in CHANNELS else None

    @property
    def fits(self) -> bool:
        """Whether the unit, where there is one, can be one of the channel; some controllers steer the rudder by a pulse
        width."""
        if not self.units or self.channel is None:
            return True
        return bool({QUANTITIES[unit_of(self.channel)], "percent"} & set(self.units)) or (
            self.channel in ("delta", "delta_c") and "shaft" in self.units
        )


def read_head(name: str, unit_text: str = "") -> Head:
    """Read the head `name` of a column; `unit_text` is the unit from a row of units under the heads ("" where there is
    none)."""
    inside = [part.strip() for part in re.findall(_BRACKETS, name)]
    unit = next((part for part in [unit_text, *inside] if part and units_of(part)), "")
    words = re.sub(_BRACKETS, lambda found: " " if found[1].strip() == unit else f" {found[1]} ", name)
    tokens = _tokens(words)
    if not unit:
        tokens, unit = _unit_at_end(words, tokens)
    tokens = [part for token in tokens for part in _without_number(token)]
    meanings, qualifiers, left = _named(tokens)
    if (left or len(set(meanings)) != 1) and (path := re.fullmatch(r"[^.\s]+\.(?:[^.\s]+\.)*([^.\s]+)", words.strip())):
        of_field = _named(_tokens(path[1]))  # a field of a structure, such as gps.t
        if of_field[0] and not of_field[2]:
            meanings, left, qualifiers = of_field[0], [], qualifiers | of_field[1]
    if set(tokens) & _SIDE_LETTERS - {"r"} and not {"n", "delta", "F_b", "F_s"} & set(
        meanings
    ):  # x_p is no position to port
        meanings, left = [], tokens
    meaning = meanings[0] if len(set(meanings)) == 1 else None
    base = tuple(
        t for t in tokens if not ({"+port", "+starboard", "+first", "+second"} & {m for m, _ in _words().get((t,), ())})
    )
    return Head(name, meaning, frozenset(qualifiers), not left and meaning is not None, unit, units_of(unit), base)


def units_of(text: str) -> dict[str, str]:
    """Unit that a text stands for, for each quantity that has such a unit: "kN" is a force, "kn" a speed."""
    plain = _plain_unit(text)
    found = {quantity: unit for quantity, unit in _units().get(plain, ())}
    if {"force", "speed"} <= set(found) and text.strip() in ("kN", "kn"):
        found.pop("speed" if text.strip() == "kN" else "force")
    return found


def _without_number(token: str) -> list[str]:
    """Head split before its number, 'rpm1' as 'rpm', '1', where the whole is no word of the table."""
    known = any(token in phrase for phrase in _words())
    found = re.fullmatch(r"([a-z]+)(\d)", token)
    return [found[1], found[2]] if found and not known else [token]


def _named(tokens: list[str]) -> tuple[list[str], set[str], list[str]]:
    """Words of a head as (meanings, qualifiers, words left over), the longest phrases first."""
    whole = "".join(tokens)
    if len(tokens) == 1 and (found := _joined().get(whole)):  # such as 'rudderangle'
        return [found], set(), []
    table, meanings, qualifiers, left = _words(), [], set(), []
    k = 0
    while k < len(tokens):
        for length in range(min(len(tokens) - k, 5), 0, -1):
            phrase = tuple(tokens[k : k + length])
            found_here = table.get(phrase, ())
            if found_here:
                break
        else:
            left.append(tokens[k])
            k += 1
            continue
        names = [m for m, _ in found_here if not m.startswith("+")]
        marks = {m for m, _ in found_here if m.startswith("+")}
        alone = len("".join(phrase)) > _SHORT or len(tokens) == len(phrase)
        if names and (alone or not marks) and not (marks and _mark_wins(tokens, phrase)):
            meanings += [names[0]] if alone else []
            left += [] if alone else list(phrase)
        elif marks:
            qualifiers |= marks
        else:
            left += phrase
        k += length
    if (
        not meanings
        and len(rest := [t for t in tokens if not _is_mark(t)]) == 1
        and (names := [m for m, _ in table.get((rest[0],), ()) if m[0] != "+"])
    ):
        meanings, left = (
            names[:1],
            [t for t in left if t != rest[0]],
        )  # a short word whose neighbours only qualify it, such as 'n_stbd'
    return meanings, qualifiers, left


def _mark_wins(tokens: list[str], phrase: tuple[str, ...]) -> bool:
    """Whether a word that both names and qualifies qualifies here: in 'shaft speed' the shaft does, in 'shaft' it
    names."""
    rest = [t for t in tokens if t not in phrase]
    return any(not m.startswith("+") and len(t) > _SHORT for t in rest for m, _ in _words().get((t,), ()))


def _is_mark(token: str) -> bool:
    return any(
        m in ("+order", "+port", "+starboard", "+first", "+second", "+plain", "+true")
        for m, _ in _words().get((token,), ())
    )


def _unit_at_end(words: str, tokens: list[str]) -> tuple[list[str], str]:
    """Unit without brackets at the end, such as in 'speed_kn', 'Fahrt kn', 'rudder, deg' or 'u_m_s'; some text must
    remain before it."""
    last = re.split(r"[\s,;_]+", words.strip())[-1]
    if (
        len(re.split(r"[\s,;_]+", words.strip())) > 1
        and units_of(last)
        and last.casefold() not in ("n", "m", "s", "t", "h", "g", "v", "w", "a", "k", "count", "rev")
    ):
        cut = len(_tokens(last))
        if len(tokens) > cut:
            two = " ".join(tokens[-2:])
            return (tokens[:-cut], last) if cut > 1 or len(tokens) < 3 or not units_of(two) else (tokens[:-2], two)
    if len(tokens) > 1 and tokens[-1] in ("us", "ms", "ns"):
        return tokens[:-1], tokens[-1]
    for length in (3, 2):
        text = " ".join(tokens[-length:])
        if len(tokens) > length and units_of(text):
            return tokens[:-length], text
    if len(tokens) > 1 and units_of(tokens[-1]) and len(tokens[-1]) > _SHORT:
        return tokens[:-1], tokens[-1]
    for k, token in enumerate(tokens[1:], start=1):
        if token in ("deg", "rad", "grad", "knots") and units_of(token):
            return tokens[:k] + tokens[k + 1 :], token
    if len(tokens) == 1 and units_of(words.strip()) and not _words().get((tokens[0],)):
        return tokens, words.strip()
    return tokens, tokens[0] if len(tokens) == 1 and "shaft" in units_of(tokens[0]) else ""


def plain(text: str) -> str:
    """Text in lower case without accents."""
    return "".join(
        c for c in unicodedata.normalize("NFKD", text.translate(_LETTERS)) if not unicodedata.combining(c)
    ).casefold()


def _tokens(text: str) -> list[str]:
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", text.translate(_LETTERS))
    return re.findall(r"e7|[a-z]+\d?|\d+", plain(text))


def _plain_unit(text: str) -> str:
    return (
        re.sub(r"\s+", " ", plain(text.replace("²", "2").replace("·", ".").replace("\u2212", "-").replace("⁻¹", "-1")))
        .strip()
        .rstrip(".")
    )


@cache
def _words() -> dict[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Phrases with (meaning, language) of each."""
    table: dict[tuple[str, ...], list[tuple[str, str]]] = {}
    for row in _rows("heads.csv"):
        entries = table.setdefault(tuple(_tokens(row["word"])), [])
        if row["meaning"] not in [m for m, _ in entries]:
            entries.append((row["meaning"], row["language"]))
    return {phrase: tuple(found) for phrase, found in table.items()}


@cache
def _joined() -> dict[str, str]:
    """Phrases of several words written as one."""
    return {
        "".join(phrase): names[0]
        for phrase, found in _words().items()
        if len(phrase) > 1 and (names := [m for m, _ in found if m[0] != "+"])
    }


@cache
def _units() -> dict[str, tuple[tuple[str, str], ...]]:
    table: dict[str, dict[str, str]] = {}
    for row in _rows("units.csv"):
        table.setdefault(_plain_unit(row["word"]), {}).setdefault(row["quantity"], row["unit"])
    return {word: tuple(found.items()) for word, found in table.items()}


def _rows(name: str) -> list[dict[str, str]]:
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))
