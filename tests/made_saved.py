"""Saved models that are changed on purpose."""

from __future__ import annotations

import json

import numpy as np

from shipbench.predictors._saved import _digest


def signed_anew(folder, change_meta=lambda meta: meta, change_arrays=lambda arrays: arrays):
    """As somebody would write a wrong model by hand, digest and all."""
    meta = json.loads((folder / "model.json").read_text())
    with np.load(folder / "arrays.npz") as file:
        arrays = change_arrays({k: file[k] for k in file.files})
    np.savez(folder / "arrays.npz", **arrays)
    meta = change_meta({k: v for k, v in meta.items() if k != "digest"})
    (folder / "model.json").write_text(
        json.dumps({**meta, "digest": _digest(meta, (folder / "arrays.npz").read_bytes())})
    )
