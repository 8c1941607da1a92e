"""Numbers as written in logs: decimal comma, thousands, typographic minus signs, Fortran's exponent. Ambiguous numbers
are refused."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .mapping import Layout

_MARKS = {".": r"\.", ",": ",", " ": "[ \u00a0\u2009\u202f]", "'": "['\u2019]"}
_MINUS = "[\u2212\u2013\ufe63\uff0d]"
_GROUPED = r"^[-+]?[1-9]\d{{0,2}}({mark}\d{{3}})+({decimal}\d*)?$"
_MARKED = r"^[-+]?\d*{mark}\d+([eE][-+]?\d+)?$"


class UnreadError(Exception):
    """Error for a cell that is no number: its place in the array, and the advice."""

    def __init__(self, row: int, hint: str = "") -> None:
        super().__init__(hint)
        self.row, self.hint = row, hint


@dataclass(frozen=True)
class Survey:
    """Decimal marks that a block of cells has with certainty: 4,13 is a decimal comma; 1,090 may be a thousand and
    ninety."""

    points: bool
    commas: bool


def survey(columns: Iterable[pa.Array]) -> Survey:
    """Decimal marks of text columns; each (n,) text, null where empty."""
    texts = list(columns)
    return Survey(*(any(_any(_decimal(text, mark)) for text in texts) for mark in (".", ",")))


def to_floats(text: pa.Array, layout: Layout, around: Callable[[], Survey]) -> pa.Array:
    """Numbers (n,) of trimmed cells (null where there is none); `around` surveys all columns of the block.

    Raises:
        UnreadError: a cell is no number, or one that can be read in two ways.
    """
    plain = layout.decimal == "." and layout.thousands is None
    if plain:
        try:
            values = text.cast(pa.float64())
        except pa.ArrowInvalid:
            pass
        else:
            _check_whole(text, layout)
            return values
    number = pc.replace_substring_regex(text, _MINUS, "-")
    number = pc.replace_substring_regex(number, r"^([-+]?[\d.,]+)[dD]([-+]?\d+)$", r"\1e\2")
    if layout.thousands is not None:
        number = _ungrouped(number, layout)
    elif layout.decimal == ",":
        _check_points(number, around())
    if layout.decimal == ",":
        number = pc.replace_substring(number, ",", ".")
    try:
        return number.cast(pa.float64())
    except pa.ArrowInvalid:
        cells = number.to_pylist()
        row = next(k for k, cell in enumerate(cells) if cell is not None and not _reads(cell))
        raise UnreadError(row, _advice(text[row].as_py(), layout, around())) from None


def _any(mask: pa.Array) -> bool:
    return bool(pc.any(mask).as_py())


def _has(text: pa.Array, pattern: str) -> pa.Array:
    return pc.fill_null(pc.match_substring_regex(text, pattern), False)


def _grouped(text: pa.Array, mark: str) -> pa.Array:
    """Whether a cell may be digits in groups of three."""
    return _has(text, _GROUPED.format(mark=_MARKS[mark], decimal={",": r"\.", ".": ","}.get(mark, "[.,]")))


def _decimal(text: pa.Array, mark: str) -> pa.Array:
    """Whether the mark in a cell can only be a decimal one."""
    return pc.and_not(_has(text, _MARKED.format(mark=_MARKS[mark])), _grouped(text, mark))


def _first(mask: pa.Array) -> int:
    return int(np.argmax(mask.to_numpy(zero_copy_only=False)))


def _check_whole(text: pa.Array, layout: Layout) -> None:
    """Refuse whole numbers that cross 1000 as 990, 1.090: the point would be read as a decimal one."""
    if "decimal" in layout.model_fields_set:
        return
    pointed = pc.fill_null(pc.match_substring(text, "."), False)
    if not _any(pointed) or pc.all(pointed).as_py():
        return
    whole, grouped = _has(text, r"^[-+]?[1-9]\d\d$"), _grouped(text, ".")
    if _any(whole) and pc.all(pc.or_(grouped, pc.invert(pointed))).as_py() and not _any(_has(text, r"\d{4}")):
        raise UnreadError(
            _first(grouped),
            ' It may be a thousand or a fraction. Set [file] thousands = "." in the mapping, or decimal = "." if it '
            "is a fraction.",
        )


def _ungrouped(number: pa.Array, layout: Layout) -> pa.Array:
    mark = layout.thousands or ""
    grouped = rf"^[-+]?\d{{1,3}}({_MARKS[mark]}\d{{3}})+({_MARKS[layout.decimal]}\d*)?$"
    odd = pc.and_not(_has(number, _MARKS[mark]), _has(number, grouped))
    if _any(odd):
        raise UnreadError(
            _first(odd), f' With [file] thousands = "{mark}", groups of three digits are accepted, such as 1{mark}090.'
        )
    return pc.replace_substring_regex(number, _MARKS[mark], "")


def _check_points(number: pa.Array, around: Survey) -> None:
    """Refuse points where the decimal mark is a comma, and commas where only points can be decimal."""
    pointed, commas = _has(number, r"\d\.\d|^[-+]?\.\d"), _has(number, ",")
    if _any(pointed) and not _any(_decimal(number, ".")):
        raise UnreadError(
            _first(pointed),
            ' [file] decimal is ",", so its point may stand for thousands. Set thousands = "." in [file] if it does.',
        )
    if _any(commas) and _any(_decimal(number, ".")):
        raise UnreadError(
            _first(commas), " Other cells of the column have decimal points. Write the log with one decimal mark."
        )
    if _any(commas) and around.points and not _any(_decimal(number, ",")):
        raise UnreadError(
            _first(commas),
            " Other numbers of the log have decimal points, so its comma may stand for thousands. "
            'Set decimal = "." and thousands = "," in [file] if it does; else write the log with one decimal mark.',
        )


def _advice(cell: str, layout: Layout, around: Survey) -> str:
    """Advice on a cell that is no number, from all cells of the block."""
    if layout.decimal == "." and "," in cell:
        grouped = _any(_grouped(pa.array([cell]), ","))
        if around.points and around.commas:
            return " Points and commas are decimal marks in this log. Write it with one decimal mark."
        if grouped and around.points:
            return ' Other numbers have decimal points: set [file] thousands = "," in the mapping.'
        if around.commas:
            return ' Set [file] decimal = "," in the mapping.'
        if grouped:
            return ' Set [file] thousands = "," if it is a thousand, or decimal = "," if it is a fraction.'
    for mark in (" ", "'"):
        if layout.thousands is None and _any(_grouped(pa.array([cell]), mark)):
            return f' Set [file] thousands = "{mark}" in the mapping if it is a thousand.'
    return ""


def _reads(text: str) -> bool:
    try:
        pa.scalar(text).cast(pa.float64())
    except pa.ArrowInvalid:
        return False
    return True


def no_number(where: str, column: str, cell: str, hint: str, what: str) -> InputError:
    """Error for a cell that is no number. Only a text without digits is offered as one for a missing value."""
    accepted = "decimal numbers and empty cells"
    if not any(c.isdigit() for c in cell):
        accepted += f', and what [missing] lists: missing = ["{cell[:20]}"] takes it as missing'
    return InputError(f"{where}: '{column}' is '{cell[:60]}', {what}.{hint} Accepted: {accepted}.")
