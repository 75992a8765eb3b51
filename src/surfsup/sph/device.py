"""Where to compute."""

from __future__ import annotations

import torch

from surfsup.errors import InputError


def choose_device(name: str | None = None) -> str:
    """The device of that name; without a name a GPU if there is one, otherwise the CPU.

    Raises:
        InputError: torch cannot use such a device here.
    """
    if name is None:
        return "cuda" if torch.cuda.is_available() else "cpu"
    kind = name.partition(":")[0]
    if kind not in ("cpu", "cuda"):
        raise InputError(f"there is no device '{name}'; give cpu or cuda")
    try:
        torch.empty(1, device=name)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).strip().splitlines()[0]
        install = (
            "" if torch.version.cuda else "; for a GPU install PyTorch with CUDA: pip install --force-reinstall torch"
        )
        raise InputError(f"the device '{name}' cannot be used here ({reason}); try --device cpu{install}") from None
    return name
