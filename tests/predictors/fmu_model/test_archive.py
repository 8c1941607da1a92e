"""Archives of strangers: what leads out of its folder, is damaged or too large is refused."""

from __future__ import annotations

import stat
import zipfile

import pytest
from made_fmu import description, write_archive

from shipbench.errors import InputError
from shipbench.predictors.fmu_model import archive
from shipbench.predictors.fmu_model.description import read_description


@pytest.mark.parametrize("name", ["../out.txt", "/etc/out.txt", "resources/../../out", "..\\out.txt", "C:\\out.txt"])
def test_a_member_that_leads_out_of_its_folder_is_refused(name, tmp_path):
    path = write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": description(), name: "x"})
    with pytest.raises(InputError, match="leads out of its folder"):
        archive.extract(path, tmp_path / "here")
    assert not (tmp_path / "here").exists()


def test_a_link_in_the_archive_is_refused(tmp_path):
    path = tmp_path / "ship.fmu"
    link = zipfile.ZipInfo("resources/link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr(link, "/etc")
    with pytest.raises(InputError, match="leads out of its folder"):
        read_description(path)


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    path = write_archive(
        tmp_path / "ship.fmu", {"modelDescription.xml": description(), "resources/zeros": b"\0" * 10**6}
    )
    monkeypatch.setattr(archive, "_MOST_UNPACKED", 500_000)
    with pytest.raises(InputError, match=r"holds 2 files of 1 MB unpacked; accepted: up to"):
        read_description(path)


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 broken"])
def test_what_is_no_archive_is_refused(content, tmp_path):
    (tmp_path / "ship.fmu").write_bytes(content)
    with pytest.raises(InputError, match="is no FMU, or it is damaged"):
        read_description(tmp_path / "ship.fmu")


def test_a_damaged_member_is_refused(tmp_path):
    path = write_archive(tmp_path / "ship.fmu", {"modelDescription.xml": description()})
    content = bytearray(path.read_bytes())
    content[200:260] = bytes(60)
    path.write_bytes(content)
    with pytest.raises(InputError, match="is no FMU, or it is damaged"):
        read_description(path)


def test_only_what_running_takes_is_extracted(tmp_path):
    (own, _), suffix = archive.here()
    files: dict[str, str | bytes] = {
        "modelDescription.xml": description(), f"binaries/{own}/ship{suffix}": b"own", "binaries/other/ship.so": b"not",
        "documentation/index.html": b"not", "resources/table.txt": b"data",
    }  # fmt: skip
    archive.extract(write_archive(tmp_path / "ship.fmu", files), tmp_path / "here")
    found = {p.relative_to(tmp_path / "here").as_posix() for p in (tmp_path / "here").rglob("*") if p.is_file()}
    assert found == {"modelDescription.xml", f"binaries/{own}/ship{suffix}", "resources/table.txt"}
