"""Files of strangers: only regular ones are opened, and sizes are known before memory is taken."""

from __future__ import annotations

import io
import os
import socket
import zipfile
from pathlib import Path

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.regular_files import (
    check_output,
    check_regular,
    make_folder,
    open_regular,
    read_bytes,
    read_json,
    read_npz,
    read_text,
)


def special(kind: str, folder: Path) -> Path:
    path = folder / "input"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "link to a device":
        path.symlink_to("/dev/zero")
    elif kind == "device":
        return Path("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "link to a pipe":
        os.mkfifo(folder / "pipe")
        path.symlink_to("pipe")
    elif kind == "dangling link":
        path.symlink_to("nowhere")
    elif kind == "link to itself":
        path.symlink_to("input")
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(os.path.relpath(path))  # the name of a socket must be short
    return path


@pytest.mark.parametrize(
    ("kind", "named"),
    [("pipe", "a named pipe"), ("link to a pipe", "a named pipe"), ("device", "a device"),
        ("link to a device", "a device"),
     ("folder", "a folder"), ("socket", "a socket"), ("dangling link", "a link to a file that does not exist"),
     ("link to itself", "Too many levels"), ("none", "No such file")],
)  # fmt: skip
def test_what_is_no_regular_file_is_never_opened(tmp_path, kind, named, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = special(kind, tmp_path)
    opened = []
    monkeypatch.setattr(os, "open", lambda *args: opened.append(args))
    for read in (check_regular, open_regular, read_bytes, read_text, read_json, read_npz):
        with pytest.raises(InputError, match=named):
            read(path)
    assert not opened


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(tmp_path, monkeypatch):
    path, real = tmp_path / "log.csv", os.open
    path.write_text("t,x\n")

    def swapped(name, *args):
        path.unlink()
        os.mkfifo(path)
        return real(name, *args)

    monkeypatch.setattr(os, "open", swapped)
    with pytest.raises(InputError, match="a named pipe"):
        open_regular(path)


@pytest.mark.parametrize("name", ["a\0b", "\ud800"])
def test_a_name_that_no_file_can_have_is_refused(name):
    with pytest.raises(InputError, match="no file can have this name"):
        read_text(name)


def test_files_and_links_to_files_are_read(tmp_path):
    (tmp_path / "text").write_text('{"ü": 1}', encoding="utf-8")
    (tmp_path / "link").symlink_to("text")
    assert read_json(tmp_path / "link") == {"ü": 1}
    assert check_regular(tmp_path / "link") == 9
    with open_regular(tmp_path / "text") as file:
        assert file.read() == read_bytes(tmp_path / "text")


def test_a_text_beyond_the_limit_is_refused_with_both_sizes(tmp_path):
    (tmp_path / "text").write_bytes(b"a" * 5_000_000)
    with pytest.raises(InputError, match=r"5 MB; accepted: a note of up to 1\.5 MB"):
        read_text(tmp_path / "text", "note", most=1_500_000)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xff{}", "not UTF-8"),
        (b"{", "not valid JSON"),
        (b"[" * 100_000, "nested too deeply"),
        (b"9" * 5000, "not valid JSON"),
    ],
)
def test_what_is_no_json_is_refused(tmp_path, content, message):
    (tmp_path / "d.json").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_json(tmp_path / "d.json")


def npz(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in members.items():
            packed.writestr(f"{name}.npy", content)
    return path


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def test_arrays_come_back_as_they_were(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.arange(6.0).reshape(2, 3), names=np.array(["x", "y"]))
    found = read_npz(tmp_path / "a.npz")
    np.testing.assert_array_equal(found["a"], np.arange(6.0).reshape(2, 3))
    assert found["names"].tolist() == ["x", "y"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy(np.zeros(3)).replace(b"(3,), }", b"(9" + b"0" * 10 + b",), }"), "declares the shape"),
        (npy(np.zeros(3))[:-8], "declares the shape"),
        (npy(np.zeros(3)).replace(b"NUMPY", b"NUMPI"), "magic"),
        (npy(np.zeros(3)).replace(b"(3,)", b"3,,)"), "cannot be read"),
        (b"", "cannot be read"),
    ],
)
def test_an_array_that_declares_more_than_it_holds_is_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        read_npz(npz(tmp_path / "a.npz", a=content))


def test_arrays_beyond_the_limit_and_objects_are_refused(tmp_path):
    path = npz(tmp_path / "a.npz", a=npy(np.zeros(1_000_000)), b=npy(np.zeros(1_000_000)))
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError, match=r"16 MB unpacked; accepted: up to 10 MB"):
        read_npz(path, most=10_000_000)
    np.savez(tmp_path / "o.npz", a=np.array([{}, []], dtype=object))
    with pytest.raises(InputError, match="Python objects"):
        read_npz(tmp_path / "o.npz")
    (tmp_path / "z.npz").write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match="cannot be read"):
        read_npz(tmp_path / "z.npz")


def test_what_is_written_never_replaces_what_is_read(tmp_path):
    (tmp_path / "set").mkdir()
    for name in ("log.csv", "old.csv", "set/trajectories.csv"):
        (tmp_path / name).write_text("precious")
    (tmp_path / "link.csv").symlink_to("log.csv")
    inputs = [tmp_path / "log.csv", tmp_path / "set"]
    for accepted in ("new.csv", "old.csv", "set/new.csv", "nowhere/new.csv"):
        check_output(tmp_path / accepted, inputs)
    for name in ("log.csv", "link.csv", "set/trajectories.csv", "set/../log.csv"):
        with pytest.raises(
            InputError, match=r"among the inputs of this command; it would be overwritten\. Give another --out\."
        ):
            check_output(tmp_path / name, inputs)


def test_a_device_pipe_or_folder_is_not_replaced_by_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "a named pipe"), (Path("/dev/null"), "a device"), (tmp_path, "a folder")):
        with pytest.raises(InputError, match=f"is {kind}; accepted: a new name, or a file to replace"):
            check_output(path)


def test_a_folder_is_made_or_the_reason_said(tmp_path):
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "f").write_text("precious")
    for name in ("f", "f/g"):
        with pytest.raises(InputError, match=r"cannot be made: .*; accepted: a folder"):
            make_folder(tmp_path / name)
