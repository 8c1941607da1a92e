"""Tables with columns separated by runs of blanks, as Fortran and MATLAB write them."""

from __future__ import annotations

import io
import re
from typing import Any

_INNER = re.compile(rb"[ \t]+")
_OUTER = re.compile(rb"(?m)^ | (?=\r?$)")
_BLOCK = 1 << 20


class Collapsed(io.RawIOBase):
    """Binary stream in which runs of blanks and tabs are one blank, and lines neither begin nor end with one."""

    def __init__(self, raw: Any) -> None:
        super().__init__()
        self._raw, self._rest, self._ready, self._ended = raw, b"", b"", False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._ready and not self._ended:
            block = self._raw.read(_BLOCK)
            self._ended = not block
            whole, _, self._rest = (self._rest + block).rpartition(b"\n") if block else (self._rest, b"", b"")
            self._ready = _OUTER.sub(b"", _INNER.sub(b" ", whole)) + (b"\n" if block and whole else b"")
        count = min(len(buffer), len(self._ready))
        buffer[:count] = self._ready[:count]
        self._ready = self._ready[count:]
        return count
