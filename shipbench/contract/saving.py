"""Rule on saving: the same predictions after loading, and nothing pickled."""

from __future__ import annotations

import io
import pickletools
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..predictors.base import PREDICTORS, make_predictor
from ..registry import reason
from ..specs import parse_spec
from .subject import Broken, NotApplicable, Subject


def same_after_loading(c: Subject) -> str:
    """A saved model predicts the same after loading, bit for bit, and its files hold no pickle."""
    if not callable(getattr(c.model, "save", None)):
        raise NotApplicable("the class has no save(path): a study keeps its predictions, but not the model")
    with tempfile.TemporaryDirectory(prefix="shipbench-check-") as name:
        folder = Path(name, "model")
        try:
            c.model.save(folder)
        except Exception as error:  # a stranger's model may raise anything
            raise Broken(f"save raised {reason(error)}") from None
        files = [folder] if folder.is_file() else sorted(p for p in folder.rglob("*") if p.is_file())
        if not files:
            raise Broken("save(path) wrote nothing at `path`")
        for file in files:
            if found := pickle_in(file.name, file.read_bytes()):
                raise Broken(f"{found}: a pickle runs code when it is read. Save plain arrays (numpy.savez) and JSON")
        try:
            loaded, how = _load(c, folder)
            S = c.ask(c.batch.s0, c.batch.U, model=loaded)
        except Exception as error:
            raise Broken(f"loading it again raised {reason(error)}") from None
        size = sum(file.stat().st_size for file in files)
    return f"{c.same(S, c.S, 0.0, f'loaded by {how}')}; {len(files)} files, {size / 1000:.0f} kB"


def _load(c: Subject, folder: Path) -> tuple[Any, str]:
    """Load a saved model as a study would: by its folder where the class is registered under a name, else by the
    class's own `load`."""
    if c.saved or (
        c.spec.path is None and c.spec.given is None and PREDICTORS.get(c.spec.name.partition(":")[0]) is type(c.model)
    ):
        return make_predictor(parse_spec(str(folder)), c.device), "its folder's name"
    return type(c.model).load(folder), "the class's load(path)"


def pickle_in(name: str, data: bytes) -> str:
    """Name of the file of the saved model that is, or holds, a pickle; "" if none does. Nothing is unpickled for the
    test."""
    if zipfile.is_zipfile(io.BytesIO(data)):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return next(
                (
                    f"{name}: {found}"
                    for member in archive.namelist()
                    if (found := pickle_in(member, archive.read(member)))
                ),
                "",
            )
    if data[:6] == b"\x93NUMPY":
        major = data[6]
        reader = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
        return f"{name} holds Python objects" if reader(io.BytesIO(data[8:]))[2].hasobject else ""
    if Path(name).suffix in (".pkl", ".pickle", ".joblib", ".dill"):
        return f"{name} is a pickle"
    if data[:1] == b"\x80" and data[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05"):
        return f"{name} is a pickle"
    try:  # the two oldest protocols have no mark at the beginning
        end = [position for _, _, position in pickletools.genops(data)][-1]
    except Exception:  # not the language of pickles
        return ""
    return f"{name} is a pickle" if end == len(data) - 1 else ""
