"""Tensors of safetensors files from strangers: of the types that a network has, and finite.

``load_state_dict`` of torch turns whatever it finds into the type of the network: booleans, integers, or numbers that
are infinite in single precision.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from torch import Tensor, nn

NAMED = 80  # characters of a name in a message


def read_tensors(path: Path) -> dict[str, Tensor]:
    """The tensors in the file ``path``, all finite, in memory of their own.

    Tensors that are mapped from the file begin anywhere, and products of such tensors round differently.

    Raises:
        SafetensorError: it is cut off, or no such file.
        OSError: it cannot be read.
        ValueError: a tensor has complex numbers, or numbers that are not finite.
    """
    with safe_open(path, framework="pt") as file:
        names = file.keys()  # the file itself is not a mapping
        tensors = {name: file.get_tensor(name).clone() for name in names}
    for name, tensor in tensors.items():
        if tensor.is_complex():
            raise ValueError(f"its tensor {name[:NAMED]!r} has complex numbers")
        if tensor.is_floating_point() and not bool(torch.isfinite(tensor).all()):
            raise ValueError(f"its tensor {name[:NAMED]!r} has numbers that are not finite (NaN or infinity)")
    return tensors


def load_weights(module: nn.Module, tensors: Mapping[str, Tensor]) -> None:
    """Load weights into ``module``, after they were found to be what it has.

    Raises:
        ValueError: as :func:`check_weights`.
    """
    check_weights(module, tensors)
    module.load_state_dict(tensors)


def check_weights(module: nn.Module, tensors: Mapping[str, Tensor]) -> None:
    """Require that the weights ``tensors`` are what ``module`` has.

    Raises:
        ValueError: a tensor is missing, unknown, or of another shape or type; the message names it.
    """
    own = module.state_dict()
    for name in [*own, *tensors]:
        if name not in own or name not in tensors:
            raise ValueError(f"its tensor {name[:NAMED]!r} is {'missing' if name in own else 'unknown'}")
        check_like(name, tensors[name], own[name])


def check_like(name: str, tensor: Tensor, own: Tensor) -> None:
    """Require that a tensor of a file fits the place of ``own``.

    Raises:
        ValueError: it is of another shape or type, or not finite in the type of ``own``.
    """
    if tensor.shape != own.shape:
        found, needed = tuple(tensor.shape), tuple(own.shape)
        raise ValueError(f"its tensor {name[:NAMED]!r} has the shape {found} instead of {needed}")
    if tensor.is_floating_point() != own.is_floating_point() or tensor.is_complex() != own.is_complex():
        raise ValueError(f"its tensor {name[:NAMED]!r} holds {type_name(tensor)} instead of {type_name(own)}")
    if own.is_floating_point() and not bool(torch.isfinite(tensor.to(own.dtype)).all()):
        raise ValueError(f"its tensor {name[:NAMED]!r} has numbers that are too large for {type_name(own)}")


def type_name(tensor: Tensor) -> str:
    """The type of a tensor's numbers, such as float32."""
    return str(tensor.dtype).removeprefix("torch.")


def finite_number(name: str, value: Any, least: float = -math.inf, most: float = math.inf) -> float:
    """A number of a header, from ``least`` to ``most``.

    Raises:
        ValueError: it is something else; the message names it.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{name} is {str(value)[:NAMED]!r}, not a finite number")
    if not least <= value <= most:
        raise ValueError(f"{name} is {value:.6g}, which is not from {least:g} to {most:g}")
    return float(value)


def whole_number(name: str, value: Any, least: int, most: int) -> int:
    """A whole number of a header, from ``least`` to ``most``.

    Raises:
        ValueError: it is something else; the message names it.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ValueError(f"{name} is {str(value)[:NAMED]!r}, not a whole number from {least} to {most}")
    return value


def plain_text(name: str, value: Any, longest: int = 100_000) -> str:
    """A text of a header.

    Raises:
        ValueError: it is something else or longer; the message names it.
    """
    if not isinstance(value, str) or len(value) > longest:
        raise ValueError(f"{name} is no text of at most {longest} characters")
    return value
