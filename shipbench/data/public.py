"""Public data sets that are downloaded, never distributed: the licence comes first, and every file must have the
published checksum (pooch)."""

from __future__ import annotations

import gzip
import hashlib
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError, WorkError
from ..regular_files import open_regular

_TIMEOUT_S = 30
_LARGEST = 1_000_000_000
"""Most bytes of one file, unpacked."""


@dataclass(frozen=True)
class PublicData:
    """Address of a public data set, its terms, and the checksums of its files.

    Args:
        name: registered name of the data set.
        url: the folder that the file names are relative to, of one fixed version.
        licence: short name and address of the text.
        terms: conditions of the licence, in plain words.
        citation: the papers to cite.
        registry: file of names and SHA-256 checksums, in pooch's format.
    """

    name: str
    url: str
    licence: str
    terms: str
    citation: tuple[str, ...]
    registry: Path

    @cached_property
    def checksums(self) -> dict[str, str]:
        """SHA-256 of the uncompressed content by file name."""
        lines = (
            line.split() for line in self.registry.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
        )
        return {name: digest.removeprefix("sha256:") for name, digest in lines}

    def notice(self) -> str:
        """Text for the user before anything is downloaded."""
        cite = "\n".join(f"  - {paper}" for paper in self.citation)
        return (
            f"Data set: {self.name}, {len(self.checksums)} files\nSource: {self.url}\nLicence: {self.licence}\n"
            f"{self.terms}\nPlease cite:\n{cite}"
        )

    def missing(self, folder: Path) -> list[str]:
        """Files that `folder` lacks."""
        return [name for name in self.checksums if find(folder, name) is None]

    def changed(self, folder: Path) -> list[str]:
        """Files in `folder` whose content is not the published one (missing files do not count)."""
        found = ((name, find(folder, name)) for name in self.checksums)
        return [name for name, path in found if path is not None and _digest(path) != self.checksums[name]]

    def fetch(
        self, folder: Path, source: str | None = None, told: Callable[[str], None] = lambda text: None
    ) -> list[str]:
        """Bring the files that `folder` lacks, or that are damaged there, and return their names; each is kept only if
        its checksum is right.

        Args:
            folder: where they go.
            source: another address of the same files, or a folder with a copy (plain or .gz); default: `url`.
            told: called with a line before each file.

        Raises:
            InputError: the copy lacks files, or a file is not the published one.
            WorkError: a file could not be downloaded.
        """
        import pooch
        from requests.exceptions import ConnectionError as NoConnection
        from requests.exceptions import RequestException

        online = source is None or source.startswith(("http://", "https://"))
        where = self.url if source is None else source
        if not online:
            self._check_copy(Path(where))
        pooch.get_logger().setLevel("ERROR")  # it would speak of every file; errors come as exceptions
        pup = pooch.create(
            path=folder, base_url=where if online else Path(where).absolute().as_uri(), registry=dict(self.checksums)
        )
        downloader = pooch.HTTPDownloader(timeout=_TIMEOUT_S) if online else _Copy(Path(where))
        todo = sorted({*self.missing(folder), *self.changed(folder)})
        for i, name in enumerate(todo):
            told(f"[{i + 1}/{len(todo)}] {name}")
            try:
                pup.fetch(name, downloader=downloader)
            except RequestException as error:
                reason = "no connection" if isinstance(error, NoConnection) else _short(error)
                raise WorkError(
                    f"{name} could not be downloaded from {where}: {reason}. {i} of {len(todo)} files were fetched "
                    f"and are kept in {folder}. "
                    "Try again when the network is there, or take a copy that you have: shipbench data get "
                    f"{self.name} --from FOLDER."
                ) from None
            except ValueError as error:  # pooch's word for a wrong checksum
                raise InputError(
                    f"{name} from {where} is not the published file and was refused: {_short(error)}. Take a fresh "
                    "copy of the public data."
                ) from None
            except (OSError, EOFError, zlib.error) as error:
                raise InputError(
                    f"{name} cannot be copied from {where} to {folder}: {_short(error)}. Take another copy or folder."
                ) from None
        return todo

    def _check_copy(self, folder: Path) -> None:
        if not folder.is_dir():
            raise InputError(
                f"--from {folder}: no such folder. Give the folder of your copy, or an address that begins with "
                "https://."
            )
        missing = self.missing(folder)
        if missing:
            raise InputError(
                f"{folder} lacks {len(missing)} of the {len(self.checksums)} files of {self.name}, the first is "
                f"{missing[0]}. "
                "Accepted: a copy of the source's folder (or the whole repository), files plain or .gz."
            )


def find(folder: Path, name: str) -> Path | None:
    """Path of the file `name` of a public data set in a copy: plain or .gz, in the folder itself or in its folder
    `data`."""
    candidates = (folder / part / f"{name}{end}" for part in ("", "data") for end in ("", ".gz"))
    return next((path for path in candidates if path.is_file()), None)


def _digest(path: Path) -> str:
    """SHA-256 of the content, uncompressed; a broken archive has none."""
    digest = hashlib.sha256()
    try:
        for part in _content(path):
            digest.update(part)
    except (InputError, OSError, EOFError, zlib.error):
        return ""
    return digest.hexdigest()


def _content(path: Path) -> Iterator[bytes]:
    """Content, uncompressed, piece by piece; OSError where it is larger than any published file."""
    with open_regular(path) as file:
        opened = gzip.GzipFile(fileobj=file) if path.suffix == ".gz" else file
        size = 0
        while part := opened.read(1 << 20):
            size += len(part)
            if size > _LARGEST:
                raise OSError(f"it holds more than {_LARGEST / 1e6:.0f} MB")
            yield part


@dataclass(frozen=True)
class _Copy:
    """A pooch downloader that takes the file from a folder."""

    folder: Path

    def __call__(self, url: str, output_file: str, pup: Any) -> None:
        # pooch gives the address of the file; what follows the base address is its name
        path = find(self.folder, url.removeprefix(pup.base_url))
        if path is None:
            raise FileNotFoundError(f"{url} is gone")
        with open(output_file, "wb") as here:
            here.writelines(_content(path))


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
