"""Writer of the three files of the contract, run by run, in a temporary folder that gets its final name when all is
written."""

from __future__ import annotations

import re
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import tomli_w

from ..data.files import BEFORE_CHECK, TABLES
from ..errors import InputError, option
from ..ship import Ship
from ..storage import exchange

CSV_ROWS = 200_000
_OURS = {*TABLES, "dataset.toml", "ship.toml"}


class FolderWriter:
    """Context manager: `add` runs, then `finish`. Leaving it without `finish` (an error, Ctrl-C) leaves nothing behind.

    Raises:
        InputError: the folder is there already and `force` is not set, or holds other files than a data set's, or
            cannot be written.
    """

    def __init__(self, out: Path, force: bool = False) -> None:
        self.out, self.rows = out, 0
        self._table: pa.parquet.ParquetWriter | None = None
        _check_target(out, force)
        self._target = out.resolve()  # of a link, the folder that it points to is replaced
        self._made = [folder for folder in self._target.parents if not folder.exists()]
        try:
            self._target.parent.mkdir(parents=True, exist_ok=True)
            self.fresh = Path(tempfile.mkdtemp(prefix=f".{self._target.name}.importing-", dir=self._target.parent))
        except OSError as error:
            raise self._unwritable(error) from None

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(
            f"cannot write the data set to {self.out}: {error.strerror}. Give another folder with "
            f"{option('--out', 'out=FOLDER')}."
        )

    def add(self, run: str, t: np.ndarray, columns: dict[str, np.ndarray]) -> None:
        """Write one run."""
        names = pa.array([run]).dictionary_encode().take(pa.array(np.zeros(len(t), np.int32))).cast(pa.string())
        table = pa.table({"trajectory": names, "t": t, **columns})
        try:
            if self._table is None:
                self._table = pa.parquet.ParquetWriter(self.fresh / "trajectories.parquet", table.schema)
            self._table.write_table(table)
        except OSError as error:
            raise self._unwritable(error) from None
        self.rows += len(t)

    def finish(self, description: dict[str, Any], ship: Ship) -> Path:
        """Write the two descriptions, move the folder into place and return the path of the table."""
        try:
            if self._table is not None:
                self._table.close()
            table = self.fresh / "trajectories.parquet"
            if self.rows <= CSV_ROWS:  # small enough to be opened by people
                pa.csv.write_csv(
                    pa.parquet.read_table(table),
                    self.fresh / "trajectories.csv",
                    pa.csv.WriteOptions(quoting_style="needed"),
                )
                table.unlink()
                table = self.fresh / "trajectories.csv"
            (self.fresh / "dataset.toml").write_text(tomli_w.dumps(description), encoding="utf-8")
            (self.fresh / "ship.toml").write_text(ship.to_toml(), encoding="utf-8")
            self.fresh.chmod(0o755)  # mkdtemp makes it private
            exchange(self.fresh, self._target)
        except OSError as error:
            raise self._unwritable(error) from None
        return self.out / table.name

    def __enter__(self) -> FolderWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._table is not None:
            with suppress(OSError):  # a full disk was told already
                self._table.close()
        shutil.rmtree(self.fresh, ignore_errors=True)
        with suppress(OSError):  # it is not empty: the data set is there
            for folder in self._made:
                folder.rmdir()


def _check_target(out: Path, force: bool) -> None:
    place, replacing = f"another folder with {option('--out', 'out=FOLDER')}", option("--force", "force=True")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; accepted: a folder that is not there yet. Give {place}.")
    if not out.is_dir():
        return
    held = sorted(p.name for p in out.iterdir())
    if held and not force:
        raise InputError(
            f"folder {out} is there already ({', '.join(held[:4])}). Give {place}, or {replacing} to replace that "
            "data set."
        )
    if others := [name for name in held if name not in _OURS and not name.startswith(BEFORE_CHECK)]:
        raise InputError(
            f"folder {out} holds more than a data set ({', '.join(others[:4])}); {replacing} replaces only a data "
            f"set. Give {place}."
        )


def run_name(text: str) -> str:
    """Name reduced to letters, digits, '_', '-', '.' and '@': safe in paths, TOML and spreadsheets (no name begins like
    a formula)."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", text).strip("_.-")[:80] or "run"
