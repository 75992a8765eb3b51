"""Files of neural surfaces: safetensors with a JSON header, nothing executable."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from surfsup.checked.tensors import finite_number, read_tensors
from surfsup.errors import InputError
from surfsup.sdf.grid import SdfGrid

MAX_BOUND = 4.0  # of coordinates in units of the cube, whose side is 2
SIREN = "surfsup-siren-1"
DEEPSDF = "surfsup-deepsdf-1"
SAMPLES = "surfsup-samples-1"
COMMANDS = {SIREN: "surfsup fit siren", DEEPSDF: "surfsup fit deepsdf", SAMPLES: "surfsup fit deepsdf"}


def write(path: Path, kind: str, header: dict[str, Any], tensors: dict[str, Tensor]) -> None:
    """Write ``tensors`` and ``header``; an existing file is replaced once everything is written.

    Raises:
        InputError: The disk is full or not writable.
    """
    partial = path.with_name(path.name + ".partial")
    metadata = {"format": kind, "surface": json.dumps(header)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_file({name: value.contiguous() for name, value in tensors.items()}, partial, metadata)
        partial.replace(path)
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: cannot be written ({error})") from None


def read_format(path: Path) -> str:
    """The format of the neural surface in ``path``: SIREN or DEEPSDF.

    Raises:
        InputError: The file is missing, truncated, or contains something else.
    """
    found = read_metadata(path).get("format", "something else")
    if found not in (SIREN, DEEPSDF):
        raise InputError(
            f"{path}: holds '{found}', no neural surface; make one with '{COMMANDS[SIREN]}' or '{COMMANDS[DEEPSDF]}'"
        )
    return found


def read(path: Path, kind: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Header and tensors of the file ``path`` of format ``kind``.

    Raises:
        InputError: The file is missing, truncated, of another format, or damaged.
    """
    metadata = read_metadata(path)
    if metadata.get("format") != kind:
        raise InputError(
            f"{path}: holds '{metadata.get('format', 'something else')}', not '{kind}'; "
            f"make one with '{COMMANDS[kind]}'"
        )
    try:
        tensors = read_tensors(path)
        header = json.loads(metadata["surface"])
    except (SafetensorError, OSError, KeyError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: its header or its tensors are damaged ({one_line(error)}); fit it again") from None
    if not isinstance(header, dict):
        raise InputError(f"{path}: its header is damaged (it is not a mapping)")
    return header, tensors


def read_metadata(path: Path) -> dict[str, str]:
    """The metadata of a safetensors file.

    Raises:
        InputError: The file is missing, truncated, or not safetensors.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file of a neural surface")
    try:
        with safe_open(path, framework="pt") as file:
            return file.metadata() or {}
    except SafetensorError as error:
        raise InputError(
            f"{path}: is cut off or not a safetensors file ({one_line(error)}); pickled weights are refused"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def checked_bounds(bounds: Tensor) -> Tensor:
    """The box (2, 3) of a solid in its cube of side 2.

    Raises:
        ValueError: it is no box, or another one.
    """
    if not bounds.is_floating_point() or bounds.numel() != 6:
        raise ValueError("bounds are no two corners")
    lower, upper = bounds.reshape(2, 3)
    if not bool((upper > lower).all()) or float(bounds.abs().max()) > MAX_BOUND:
        raise ValueError(f"bounds are from {lower.tolist()} to {upper.tolist()}")
    return bounds.reshape(2, 3)


def checked_grid(values: Tensor, lower: Tensor, cell: Any) -> SdfGrid:
    """The grid of distances (X, Y, Z) from the corner ``lower`` (3,).

    Raises:
        ValueError: they are no grid.
    """
    cell = finite_number("the cell", cell, 1e-3, MAX_BOUND)
    if not (values.is_floating_point() and lower.is_floating_point() and lower.shape == (3,)):
        raise ValueError("the grid holds no numbers")
    if values.ndim != 3 or min(values.shape) < 3 or float(lower.abs().max()) > MAX_BOUND:
        raise ValueError(f"the grid has the shape {tuple(values.shape)} and begins at {lower.tolist()}")
    if not float(values.float().abs().max()) <= MAX_BOUND * 4:
        raise ValueError("the grid has distances that no shape in the cube has")
    return SdfGrid.from_distances(values, lower, cell)


def architecture_error(path: Path, error: Exception) -> InputError:
    """The error for a file whose tensors do not fit the architecture in its header."""
    return InputError(f"{path}: its tensors do not fit its architecture ({one_line(error)})")


def with_prefix(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names start with ``prefix``, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def one_line(error: Exception) -> str:
    """The message of ``error`` in one line."""
    return " ".join(str(error).split())[:120]
