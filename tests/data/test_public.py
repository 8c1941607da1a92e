"""Public data sets: licence first, checksums always, from a server, from a local copy, and with nothing at hand (all on
files made from formulas)."""

from __future__ import annotations

import gzip
import hashlib
import os
import pty
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from test_esso_osaka_conversion import recorded
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data import esso_osaka
from shipbench.data import public as public_module
from shipbench.data.base import DATASETS, load_dataset
from shipbench.data.public import PublicData
from shipbench.errors import WorkError

NAMES = (
    "turning/turn_14-Oct-2020_14_08_51.csv",
    "zigzag/zigzag_31-Jul-2020_13_42_53.csv",
    "random/random_06-Aug-2020_16_24_25_1.csv",
)
SHARED = Path(__file__).parents[3] / "shared" / "data" / "esso-osaka-frt"


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format, *args):
        pass


@pytest.fixture
def copy(tmp_path) -> Path:
    """Three files as the source lays them out."""
    folder = tmp_path / "source"
    for place, name in enumerate(NAMES):
        (folder / name).parent.mkdir(parents=True)
        recorded(start=10.0 * place).to_csv(folder / name, index=False)
    return folder


@pytest.fixture
def server(copy):
    """Address of a web server that offers the copy."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(copy))) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{http.server_port}/"
        http.shutdown()


@pytest.fixture
def public(copy, server, tmp_path, monkeypatch) -> PublicData:
    """esso_osaka with the checksums and the address of these files, and an empty cache."""
    registry = tmp_path / "files.txt"
    registry.write_text(
        "# a comment\n" + "".join(f"{n} sha256:{hashlib.sha256((copy / n).read_bytes()).hexdigest()}\n" for n in NAMES)
    )
    found = replace(esso_osaka.PUBLIC, registry=registry, url=server)
    monkeypatch.setattr(esso_osaka, "PUBLIC", found)
    monkeypatch.setattr(esso_osaka, "DATASET", replace(esso_osaka.DATASET, public=found))
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("SHIPBENCH_ESSO_OSAKA", raising=False)
    monkeypatch.chdir(tmp_path)
    return found


def get(*arguments: object):
    return CliRunner().invoke(app, ["data", "get", "esso_osaka", *map(str, arguments)])


def kept(tmp_path: Path) -> list[str]:
    return sorted(p.name for p in (tmp_path / "cache").rglob("*") if p.is_file())


def test_a_download_after_the_licence_is_accepted_loads_and_is_not_repeated(public, tmp_path):
    result = get("--accept-licence")
    assert result.exit_code == 0, result.output
    shown, fetched = result.stderr.index("CC BY-NC-SA 4.0"), result.stderr.index("[1/3]")
    assert shown < fetched, "the licence comes first"
    for word in ("NON-COMMERCIAL", "Wakita et al. (2022)", "10.1007/s00773-022-00889-3", public.url):
        assert word in result.stderr
    data = load_dataset("esso_osaka")
    assert {r.id: r.meta.split for r in data.runs} == {
        Path(n).stem: "test" if "zigzag" in n else "train" for n in NAMES
    }
    assert [r.meta.manoeuvre for r in data.runs] == ["turn", "zigzag", "random"]
    again = get()
    assert again.exit_code == 0
    assert "already" in again.stdout
    assert "Licence" not in again.stderr


def test_without_acceptance_nothing_is_fetched(public, tmp_path):
    result = get()
    assert result.exit_code == 2
    assert "NON-COMMERCIAL" in result.stderr
    assert "Add --accept-licence" in result.stderr
    assert kept(tmp_path) == []


@pytest.mark.parametrize(("answer", "code", "files"), [(b"n\n", 2, 0), (b"y\n", 0, 3)])
def test_on_a_terminal_the_user_is_asked(public, tmp_path, answer, code, files):
    program = (
        "import sys; from dataclasses import replace; from pathlib import Path; from shipbench.data import "
        "esso_osaka as e\n"
        f"p = replace(e.PUBLIC, registry=Path({str(public.registry)!r}), url={public.url!r}); e.DATASET = "
        "replace(e.DATASET, public=p)\n"
        "from shipbench.cli.app import main; sys.argv = ['shipbench', 'data', 'get', 'esso_osaka']; main()"
    )
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        os.close(theirs)
        os.write(ours, answer)
        _, said = process.communicate(timeout=60)
        os.close(ours)
    assert process.returncode == code, said
    assert b"Do you accept the licence? [y/N]" in said
    assert len(kept(tmp_path)) == files


def flip(path: Path) -> None:
    """One changed byte in the middle."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("place", ["server", "folder"])
def test_a_changed_byte_is_refused_by_name_and_the_next_call_goes_on_from_there(public, copy, tmp_path, place):
    good = (copy / NAMES[1]).read_bytes()
    flip(copy / NAMES[1])
    arguments = ["--accept-licence", *(["--from", copy] if place == "folder" else [])]
    result = get(*arguments)
    assert result.exit_code == 2
    assert f"{NAMES[1]} from" in result.stderr
    assert "not the published file and was refused" in result.stderr
    assert Path(NAMES[1]).name not in kept(tmp_path)
    (copy / NAMES[1]).write_bytes(good)
    assert get(*arguments).exit_code == 0
    assert len(kept(tmp_path)) == 3


@pytest.mark.parametrize("form", ["plain", "repository", "gzip"])
def test_a_copy_works_without_a_network(public, copy, tmp_path, form):
    if form == "repository":
        (tmp_path / "repository").mkdir()
        copy = copy.rename(tmp_path / "repository" / "data").parent
    if form == "gzip":
        for name in NAMES:
            (copy / f"{name}.gz").write_bytes(gzip.compress((copy / name).read_bytes()))
            (copy / name).unlink()
    direct = load_dataset(f"esso_osaka[path={copy}]")
    assert get("--from", copy, "--accept-licence", "-q").exit_code == 0
    shutil.rmtree(copy)
    assert load_dataset("esso_osaka").fingerprint == direct.fingerprint


def test_a_file_that_changed_after_the_download_is_refused_on_loading_and_mended_by_get(public, tmp_path):
    get("--accept-licence")
    flip(tmp_path / "cache/public/esso_osaka" / NAMES[0])
    result = CliRunner().invoke(app, ["data", "check", "esso_osaka"])
    assert result.exit_code == 2
    assert f"1 of 3 files differ from the published ones by checksum, the first is {NAMES[0]}" in result.stderr
    assert get("--accept-licence").stderr.count("/1] turning") == 1
    assert CliRunner().invoke(app, ["data", "check", "esso_osaka"]).exit_code == 0


def test_a_changed_copy_of_the_users_own_is_used_and_said(public, copy):
    assert not any("checksum" in note for note in load_dataset(f"esso_osaka[path={copy}]").notes)
    table = recorded().assign(**{"r_angvelo [rad/s]": 0.5})
    table.to_csv(copy / NAMES[0], index=False)
    assert any(f"the first is {NAMES[0]}" in note for note in load_dataset(f"esso_osaka[path={copy}]").notes)


def test_offline_with_nothing_one_message_says_what_to_do(public, monkeypatch, tmp_path):
    monkeypatch.setattr(esso_osaka, "__file__", str(tmp_path / "a/b/c.py"))  # no ../shared beside the package either
    result = CliRunner().invoke(app, ["data", "check", "esso_osaka"])
    assert result.exit_code == 2
    assert "shipbench data get esso_osaka --from FOLDER" in result.stderr
    result = get("--accept-licence", "--from", "http://127.0.0.1:9/")
    assert result.exit_code == 1
    assert "no connection" in result.stderr
    assert "--from FOLDER" in result.stderr
    assert kept(tmp_path) == []
    with pytest.raises(WorkError, match="404"):
        replace(public, url=public.url + "elsewhere/").fetch(tmp_path / "cache")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("esso_osaka", "--from", "nowhere", "--accept-licence"), "no such folder"),
        (("esso_osaka", "--from", "empty", "--accept-licence"), "lacks 3 of the 3 files"),
        (("harbour90",), "it is made: shipbench data make harbour90"),
        (("esso_osako",), "Did you mean 'esso_osaka'"),
    ],
)
def test_bad_input_is_one_message(public, tmp_path, arguments, message):
    (tmp_path / "empty").mkdir()
    result = CliRunner().invoke(app, ["data", "get", *arguments])
    assert result.exit_code == 2
    assert message in result.stderr
    assert kept(tmp_path) == []


def test_the_published_registry_names_a_fixed_commit_and_34_files():
    public = DATASETS.get("esso_osaka").public
    assert len(public.checksums) == 34
    assert all(len(digest) == 64 for digest in public.checksums.values())
    assert "/e694dfd62932bff755f3bc975b5863d649023bc0/data/" in public.url
    stems = {Path(name).stem for name in public.checksums}
    assert set(esso_osaka._PUBLISHED_TEST) < stems


@pytest.mark.skipif(not SHARED.is_dir(), reason="no copy of the Esso Osaka data here (not distributed)")
def test_the_real_copy_has_the_published_checksums_and_gives_the_same_runs_through_get(tmp_path, monkeypatch):
    monkeypatch.setenv("SHIPBENCH_CACHE", str(tmp_path))
    monkeypatch.delenv("SHIPBENCH_ESSO_OSAKA", raising=False)
    direct = load_dataset(f"esso_osaka[path={SHARED}]")
    assert get("--from", SHARED, "--accept-licence", "-q").exit_code == 0
    fetched = load_dataset("esso_osaka")
    assert {r.id: r.meta for r in fetched.runs} == {r.id: r.meta for r in direct.runs}
    assert fetched.notes == direct.notes
    ours = {r.id: r for r in direct.runs}
    for run in fetched.runs:
        np.testing.assert_array_equal(run.states, ours[run.id].states)


def test_a_file_that_unpacks_without_end_is_not_the_published_one(tmp_path, monkeypatch):
    content = b"0" * 3_000_000
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(content))
    assert public_module._digest(tmp_path / "a.csv.gz") == hashlib.sha256(content).hexdigest()
    monkeypatch.setattr(public_module, "_LARGEST", 2_000_000)
    assert public_module._digest(tmp_path / "a.csv.gz") == ""
    os.mkfifo(tmp_path / "b.csv")
    assert public_module._digest(tmp_path / "b.csv") == ""
