"""Check of MATLAB files of versions 5 to 7 before scipy reads them: it trusts sizes and nesting, and crashes on deep
ones."""

from __future__ import annotations

import struct
import zlib
from typing import IO

MOST_MATLAB = 1_100_000_000
"""Most bytes of a file unpacked; it is read whole."""
_MOST_PARTS = 5_000_000
"""Most arrays in cells and structs; each takes some 200 bytes of memory, however small it is."""
_DEEPEST = 32
_MATRIX, _COMPRESSED = 14, 15
_KNOWN = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 14, 15, 16, 17, 18))
"""Kinds of elements inside an array."""
_CELL, _STRUCT, _OBJECT = 1, 2, 3


def check_matlab(file: IO[bytes]) -> None:
    """Check all elements of an open file, and leave it at its beginning.

    A file of another version is left to its reader.

    Raises:
        ValueError: it holds too much, is nested too deeply, or declares more elements than it holds.
    """
    order = {b"IM": "<", b"MI": ">"}.get(file.read(128)[126:128])
    total = parts = 0
    while order and len(tag := file.read(8)) == 8:
        kind, size = struct.unpack(f"{order}II", tag)
        data = (
            _unpacked(file, size, MOST_MATLAB - total)
            if kind == _COMPRESSED
            else tag + file.read(min(size, MOST_MATLAB + 1))
        )
        total += len(data)
        if total > MOST_MATLAB:
            raise ValueError(f"it holds more than {MOST_MATLAB / 1e6:.0f} MB unpacked; accepted: up to that")
        parts += _check_parts(memoryview(data), order)
        if parts > _MOST_PARTS:
            raise ValueError(f"it holds more than {_MOST_PARTS} arrays in cells and structs; accepted: up to that")
    file.seek(0)


def _unpacked(file: IO[bytes], size: int, most: int) -> bytes:
    packed, pieces, total = zlib.decompressobj(), [], 0
    while size > 0 and total <= most and (part := file.read(min(size, 1 << 16))):
        size -= len(part)
        pieces.append(packed.decompress(part, max(most - total, 0) + 1))
        total += len(pieces[-1])
    return b"".join(pieces)


def _check_parts(data: memoryview, order: str) -> int:
    """Count the arrays in the element `data`. A loop, not a recursion: nesting has no limit."""
    found, todo = 0, [(0, len(data), 0)]
    while todo:
        at, end, depth = todo.pop()
        if depth > _DEEPEST:
            raise ValueError(f"cells and structs are nested in more than {_DEEPEST} levels; accepted: up to that")
        while at + 8 <= end:
            kind, size = struct.unpack_from(f"{order}II", data, at)
            if depth and kind & 0xFFFF not in _KNOWN:  # scipy follows a null pointer there
                raise ValueError(f"it is damaged: an element is of the unknown kind {kind & 0xFFFF}")
            if kind >> 16:  # up to four bytes, which stand in the tag itself
                at += 8
                continue
            if depth and at + 8 + size > end:  # scipy would take the memory before it reads
                raise ValueError(
                    f"it is damaged or cut short: an element declares {size} bytes and holds {end - at - 8}"
                )
            if kind == _COMPRESSED:
                raise ValueError("an element is packed twice")
            if kind == _MATRIX:
                found += 1
                inner = min(at + 8 + size, end)
                _check_count(data, at + 8, inner, order)
                todo.append((at + 8, inner, depth + 1))
            at += 8 + size + -size % 8
    return found


def _check_count(data: memoryview, at: int, end: int, order: str) -> None:
    """Refuse a cell or struct, between `at` and `end`, that declares more elements than it can hold."""
    if at + 24 > end or data[at + 8 if order == "<" else at + 11] not in (_CELL, _STRUCT, _OBJECT):
        return
    size = struct.unpack_from(f"{order}I", data, at + 20)[0]
    number, at = 1, at + 24
    for k in range(min(size, end - at) // 4):
        number *= struct.unpack_from(f"{order}i", data, at + 4 * k)[0]
    if not 0 <= 8 * number <= end - at:
        raise ValueError(f"a cell or struct declares {number} elements and holds fewer")
