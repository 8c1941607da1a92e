"""MATLAB files of strangers: nesting, counts and sizes are looked at before scipy trusts them."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from shipbench import matlab_files
from shipbench.data.mat import read_mat
from shipbench.errors import InputError
from shipbench.importing.mapping import Layout
from shipbench.importing.tables import open_table
from shipbench.matlab_files import check_matlab

HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def matrix(kind: int, dims: tuple[int, ...], inside: bytes, name: bytes = b"") -> bytes:
    return element(
        14,
        element(6, struct.pack("<II", kind, 0))
        + element(5, struct.pack(f"<{len(dims)}i", *dims))
        + element(1, name)
        + inside,
    )


def nested(levels: int, kind: int = 1) -> bytes:
    found = matrix(6, (1, 1), element(9, struct.pack("<d", 1.0)))
    for _ in range(levels - 1):
        found = matrix(kind, (1, 1), found)
    return matrix(1, (1, 1), found, b"runs")


def packed(data: bytes) -> bytes:
    small = zlib.compress(data)
    return struct.pack("<II", 15, len(small)) + small


OPAQUE = element(14, element(6, struct.pack("<II", 17, 0)) + element(1, b"a") * 3 + nested(40))
HOSTILE = {
    "deep cells": (nested(20_000), "nested in more than 32 levels"),
    "deep and packed": (packed(nested(20_000)), "nested in more than 32 levels"),
    "deep functions": (nested(40, 16), "nested in more than 32 levels"),
    "deep in an object": (OPAQUE, "nested in more than 32 levels"),
    "many cells": (matrix(1, (2**30, 1), b"", b"runs"), "declares 1073741824 elements"),
    "many structs": (
        matrix(2, (2**28, 1), element(5, struct.pack("<i", 8)) + element(1, b"a".ljust(8, b"\0")), b"runs"),
        "declares",
    ),
    "less than none": (matrix(1, (-1, 5), b"", b"runs"), "declares -5 elements"),
    "unknown kind": (matrix(4, (1, 1), element(152, b"a"), b"runs"), "unknown kind 152"),
    "packed twice": (packed(packed(nested(1))), "packed twice"),
    "numbers that are not there": (
        matrix(6, (1, 1), struct.pack("<II", 9, 2**31)),
        "declares 2147483648 bytes and holds 0",
    ),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_what_would_end_the_process_is_refused_in_one_message(tmp_path, case):
    content, message = HOSTILE[case]
    (tmp_path / "a.mat").write_bytes(HEAD + content)
    with pytest.raises(InputError, match=message):
        read_mat(tmp_path / "a.mat")


def test_more_than_memory_holds_is_refused(monkeypatch):
    monkeypatch.setattr(matlab_files, "MOST_MATLAB", 1_000_000)
    zeros = matrix(6, (200_000, 1), element(9, bytes(1_600_000)))
    half = matrix(6, (75_000, 1), element(9, bytes(600_000)))
    for content in (packed(zeros), zeros, packed(half) * 2):
        with pytest.raises(ValueError, match="more than 1 MB unpacked"):
            check_matlab(io.BytesIO(HEAD + content))
    monkeypatch.setattr(matlab_files, "_MOST_PARTS", 10)
    with pytest.raises(ValueError, match="more than 10 arrays"):
        check_matlab(io.BytesIO(HEAD + matrix(1, (20, 1), element(14, b"") * 20)))


@pytest.mark.parametrize("compressed", [True, False])
def test_ordinary_files_pass_and_are_left_at_their_beginning(compressed):
    cells = np.array([{"x": 1, "y": [1, 2, {"z": "abc"}]}, "text", 3.0], dtype=object)
    variables = {
        "a": np.zeros((3, 3)),
        "c": cells,
        "s": {"e": {}, "q": np.zeros((0, 0))},
        "st": np.zeros((1, 5), dtype=[("u", object), ("v", object)]),
    }
    file = io.BytesIO()
    savemat(file, variables, do_compression=compressed)
    file.seek(0)
    check_matlab(file)
    assert file.tell() == 0
    for content in (b"", HEAD[:50], HEAD):
        check_matlab(io.BytesIO(content))


@pytest.mark.parametrize("length", [0, 2, 50, 127, 140, 300])
def test_a_file_cut_short_is_one_message_of_either_reader(tmp_path, length):
    file = io.BytesIO()
    savemat(file, {"runs": np.arange(100.0)})
    (tmp_path / "a.mat").write_bytes(file.getvalue()[:length])
    for read in (read_mat, lambda path: open_table(path, Layout())):
        with pytest.raises(InputError, match=r"cannot be read|empty|cut short"):
            read(tmp_path / "a.mat")
