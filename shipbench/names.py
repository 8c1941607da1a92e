"""Names given by users: accepted ones, their file names, and safe display of any text on a terminal.

A name is text and never a path: every file that is named after one goes through `file_name`.
"""

from __future__ import annotations

import hashlib
import re
import unicodedata

from .errors import InputError

LONGEST = 80
"""Most characters of a name."""
LONGEST_LABEL = 1000
"""Most characters of a model's label, which may hold the path of a file and many parameters."""
LONGEST_REPR = 1000
"""Most characters of an object's display in a notebook."""
_FILE_BYTES = 200
"""Most bytes of a file name; file systems take 255, and a temporary file's name is longer than that of the final
file."""
_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories without a glyph: control characters, direction marks and zero widths, lone surrogates, line and
paragraph separators."""
_WINDOWS = re.compile(r"@[-+.\de]+s")
"""Suffix that `Dataset.windows` adds to the name of a run."""


def unseen(text: str) -> bool:
    """Whether a text holds an invisible character: a terminal, a page or a spreadsheet may take it for a command."""
    return not text.isprintable() and any(unicodedata.category(c) in _UNSEEN for c in text)


def shown(text: object, keep: str = "") -> str:
    r"""Text with every invisible character as its escape (``\x1b``, ``\u202e``), except those in `keep`."""
    text = str(text)
    if not unseen(text):
        return text
    return "".join(
        c
        if c in keep or unicodedata.category(c) not in _UNSEEN
        else c.encode("unicode_escape", "surrogatepass").decode()
        for c in text
    )


def brief(text: str, longest: int = LONGEST_REPR) -> str:
    """Text of at most `longest` characters without invisible ones, for a `repr`; a cut is marked."""
    text = shown(text, keep="\n")
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."


def check_label(text: object, key: str, longest: int = LONGEST) -> str:
    """Check that `text` can stand in a table, and return it: text without invisible characters, of at most `longest`
    characters.

    Labels are the names of runs, groups, kinds of manoeuvre and models; "zigzag 20/20" is one. `key` names the entry in
    the message.

    Raises:
        InputError: it cannot.
    """
    if not isinstance(text, str):
        raise InputError(f"{key} = {shown(text)[:80]} is no text; accepted: a name in quotation marks.")
    if unseen(text):
        raise InputError(
            f"{key} = '{shown(text)[:80]}' holds control characters; accepted: visible characters. Rename it."
        )
    if len(text) > longest:
        raise InputError(
            f"{key} = '{text[:40]}...' has {len(text)} characters; accepted: at most {longest}. Shorten it."
        )
    return text


def check_run(text: object, key: str) -> str:
    """Check that `text` can be the name of a run (see `check_label`), and return it; the suffix of windows is not
    counted.

    Raises:
        InputError: it cannot.
    """
    added = len("".join(_WINDOWS.findall(text))) if isinstance(text, str) else 0
    return check_label(text, key, LONGEST + min(added, LONGEST))


def check_name(text: object, key: str) -> str:
    """Check that `text` can be the name of a data set, and return it: a label (see `check_label`) that is not empty and
    has no part of a path.

    Raises:
        InputError: it cannot.
    """
    name = check_label(text, key)
    if not name.strip() or name.startswith(".") or ".." in name or "/" in name or "\\" in name:
        raise InputError(
            f"{key} = '{name}' is no name; accepted: text without '/', '\\', '..' or a dot at its beginning, such "
            "as 'my-trial'."
        )
    return name


def file_name(text: str) -> str:
    """File name of a label; a changed text gets a digest, so that two labels never share a file."""
    safe = re.sub(r"[^\w.+=,\[\]-]+", "-", text)[:LONGEST]
    safe = safe.encode()[:_FILE_BYTES].decode(errors="ignore")
    if safe in ("", ".", ".."):
        safe = "-"
    return safe if safe == text else f"{safe}-{hashlib.sha256(text.encode(errors='surrogatepass')).hexdigest()[:6]}"
