"""Device on which networks train and predict: the one place that reads its name and checks that it exists."""

from __future__ import annotations

import re

from ..errors import InputError
from ..extras import needed_by

_NAME = re.compile(r"cpu|cuda(:\d+)?")


def check_device(name: str, *, here: bool = True) -> str:
    """Check that `name` is a device, and return it: "cpu", "cuda" (the first GPU) or "cuda:1" (the second).

    Args:
        name: of the device.
        here: also ask whether this machine has it. PyTorch is imported only to look for a GPU.

    Raises:
        InputError: no such name, or no such device here.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(f"device '{name}' is unknown. Accepted: cpu, cuda (the first GPU), cuda:1 (the second).")
    if name != "cpu" and here:
        with needed_by(f"device '{name}'"):
            import torch

        count = torch.cuda.device_count() if torch.cuda.is_available() else 0
        if int(name.partition(":")[2] or 0) >= count:
            found = ", ".join(["cpu", *(f"cuda:{i}" for i in range(count))])
            raise InputError(
                f"device '{name}' is not here: PyTorch {torch.__version__} finds {count or 'no'} "
                f"GPU{'s' if count > 1 else ''}. "
                f"Accepted here: {found}. A GPU needs its driver and PyTorch's CUDA build."
            )
    return name
