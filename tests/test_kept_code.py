"""Compiled code in the cache folder: only what is whole and the user's alone is loaded, and no compiler is waited for
without end."""

from __future__ import annotations

import ctypes
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from shipbench import kept_code
from shipbench.kept_code import machine_code

SOURCE = "double answer(void) { return 42.0; }"
as_root = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")


@pytest.fixture
def kept(tmp_path, monkeypatch) -> Path:
    """The folder of the code in an empty cache, with a compiler."""
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("SHIPBENCH_COMPILER", raising=False)
    kept_code.compiler.cache_clear()
    kept_code._warn_once.cache_clear()
    if not kept_code.compiler()[0]:
        pytest.skip("no C compiler here")
    yield tmp_path / "cache" / "compiled"
    monkeypatch.undo()
    kept_code.compiler.cache_clear()


@pytest.fixture
def loaded(monkeypatch) -> list[Path]:
    """Paths of the libraries that are loaded."""
    paths, real = [], ctypes.CDLL
    monkeypatch.setattr(ctypes, "CDLL", lambda path: (paths.append(Path(path)), real(path))[1])
    return paths


def answer() -> float:
    function = machine_code(SOURCE, "answer", ())
    function.restype = ctypes.c_double
    return function()


def library(kept: Path) -> Path:
    (path,) = kept.glob("*.so")
    return path


def compilations(monkeypatch) -> list[int]:
    calls, real = [], kept_code._compile
    monkeypatch.setattr(kept_code, "_compile", lambda *given: (calls.append(1), real(*given))[1])
    return calls


def script(path: Path, text: str) -> str:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


def test_folders_and_code_are_the_users_alone(kept):
    old = os.umask(0o002)
    try:
        assert answer() == 42.0
    finally:
        os.umask(old)
    assert [oct(p.stat().st_mode & 0o777) for p in (kept.parent, kept, library(kept))] == ["0o700", "0o700", "0o600"]


def anew(path: Path, content: bytes) -> None:
    """Put another file in the place of one that this process has in its memory."""
    path.unlink()
    path.write_bytes(content)
    path.chmod(0o600)


def cut(path: Path) -> None:
    anew(path, path.read_bytes()[:5000])


def bit(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    anew(path, bytes(content))


def folder(path: Path) -> None:
    path.unlink()
    (path / "inside").mkdir(parents=True)


def dangling(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


DAMAGES = [cut, bit, folder, dangling, lambda p: anew(p, b""), lambda p: anew(p, b"text"), lambda p: p.chmod(0o666)]


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_or_open_to_others_is_made_again_once(kept, loaded, monkeypatch, damage):
    assert answer() == 42.0
    damage(library(kept))
    calls = compilations(monkeypatch)
    assert [answer(), answer()] == [42.0, 42.0]
    assert len(calls) == 1
    assert library(kept).stem.endswith(kept_code._digest(library(kept)))
    assert len(loaded) == 3


@as_root
def test_a_library_of_another_user_is_not_loaded(kept, loaded, monkeypatch):
    answer()
    os.chown(library(kept), 65534, 65534)
    calls = compilations(monkeypatch)
    assert answer() == 42.0
    assert len(calls) == 1
    assert library(kept).stat().st_uid == os.geteuid()


@as_root
@pytest.mark.parametrize("which", ["cache", "cache/compiled"])
def test_nothing_is_loaded_from_a_folder_of_another_user(kept, loaded, caplog, which):
    answer()
    os.chown(kept.parent.parent / which, 65534, 65534)
    with caplog.at_level(logging.WARNING):
        assert [answer(), answer()] == [42.0, 42.0]
    assert [path.parent == kept for path in loaded] == [True, False, False]
    assert caplog.text.count("belongs to another user") == 1
    assert "SHIPBENCH_CACHE" in caplog.text


def test_nothing_is_loaded_from_a_cache_that_others_can_write(kept, loaded, caplog):
    answer()
    kept.parent.chmod(0o1777)
    assert answer() == 42.0
    assert [path.parent == kept for path in loaded] == [True, False]
    assert "can be written by other users" in caplog.text


def test_a_folder_that_was_left_open_is_closed(kept, loaded):
    answer()
    kept.chmod(0o1777)
    assert answer() == 42.0
    assert kept.stat().st_mode & 0o777 == 0o700
    assert [path.parent == kept for path in loaded] == [True, True]


def test_what_killed_compilations_left_is_removed_and_what_works_is_not(kept):
    answer()
    for name in (".tmpdead", ".tmplocked"):
        (kept / name).mkdir()
        (kept / name / "rollout.c").write_text("")
    library(kept).unlink()
    with kept_code._locked(kept / ".tmplocked"):
        answer()
        assert sorted(p.name for p in kept.glob(".*")) == [".tmplocked"]


def written(path: Path) -> int:
    """The process number that a script writes into `path`, once it is there."""
    began = time.monotonic()
    while not (path.is_file() and path.read_text().endswith("\n")) and time.monotonic() - began < 30:
        time.sleep(0.02)
    return int(path.read_text())


def test_a_killed_compilation_leaves_nothing_after_the_next(kept, tmp_path):
    hanging = script(tmp_path / "cc", f'case "$1" in --version) echo 1;; *) echo $$ > {tmp_path}/pid; sleep 60;; esac')
    code = f"from shipbench.kept_code import machine_code; machine_code({SOURCE!r}, 'answer', ())"
    process = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"SHIPBENCH_COMPILER": hanging})
    orphan = written(tmp_path / "pid")
    process.kill()
    process.wait()
    os.killpg(orphan, signal.SIGKILL)
    assert list(kept.glob(".*"))
    assert answer() == 42.0
    assert [path.suffix for path in kept.iterdir()] == [".so"]


@pytest.mark.parametrize("hangs", ["*", "-std*"])
def test_a_compiler_that_hangs_is_given_up_once_and_said(kept, tmp_path, monkeypatch, caplog, hangs):
    monkeypatch.setattr(kept_code, "_SECONDS", 1.0)
    hanging = script(tmp_path / "cc", f'case "$1" in {hangs}) sleep 60 & echo $! > {tmp_path}/pid; wait;; esac; echo 1')
    monkeypatch.setenv("SHIPBENCH_COMPILER", hanging)
    kept_code.compiler.cache_clear()
    began = time.monotonic()
    assert [machine_code(SOURCE, "answer", ()) for _ in range(3)] == [None] * 3
    assert time.monotonic() - began < 10
    assert caplog.text.count("did not end within 1 s") == 1
    assert not list(kept.glob(".*"))
    left = written(tmp_path / "pid")
    while psutil.pid_exists(left) and psutil.Process(left).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() - began < 20, "what the compiler started outlives it"
        time.sleep(0.02)
