"""Export of data sets for other programs: CSV, Parquet, MATLAB."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

from ..errors import InputError
from ..records import Dataset
from ..regular_files import check_output
from .files import write_dataset
from .mat import write_mat

Format = Literal["csv", "parquet", "mat"]


def check_format(format: str | None, out: Path, source: str) -> Format:
    """Requested format; a file that ends in .mat needs no format name.

    Raises:
        InputError: no format or an unknown one, a file's name that contradicts it, or `out` is the folder that is to be
            exported (its table would be replaced).
    """
    is_mat_file = out.suffix == ".mat"
    chosen = "mat" if format is None and is_mat_file else format
    accepted = ", ".join(get_args(Format))
    if chosen is None:
        raise InputError(
            f"--out {out}: no format is given; accepted: --format {accepted}, or a file that ends in .mat."
        )
    for known in get_args(Format):
        if chosen == known:
            if is_mat_file and known != "mat":
                raise InputError(
                    f"--out {out} is a .mat file, --format is {known}; accepted: a folder for csv and parquet, or "
                    "--format mat."
                )
            if is_mat_file:
                check_output(out, [source])
            elif out.resolve() == Path(source).resolve() and Path(source).exists():
                raise InputError(f"--out {out} is what is exported; it would be overwritten. Give another place.")
            return known
    raise InputError(f"--format {chosen}; accepted: {accepted}.")


def export_dataset(dataset: Dataset, out: Path, format: Format) -> list[Path]:
    """Write `dataset` and return the paths written.

    csv, parquet: the contract's three files in the folder `out`; mat: one file, `out` or `out`/dataset.mat (see `mat`).

    Raises:
        InputError: it cannot be written there or in that format.
    """
    if format == "mat":
        path = out if out.suffix == ".mat" else out / "dataset.mat"
        write_mat(dataset, path)
        return [path]
    write_dataset(dataset, out, format=format)
    return [out / name for name in (f"trajectories.{format}", "dataset.toml", "ship.toml")]
