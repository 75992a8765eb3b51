"""Files of neural surfaces: safetensors with a JSON header, nothing that could run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from surfsup.errors import InputError

ENDING = ".safetensors"
SIREN = "surfsup-siren-1"
DEEPSDF = "surfsup-deepsdf-1"
SAMPLES = "surfsup-samples-1"
VERBS = {SIREN: "surfsup fit siren", DEEPSDF: "surfsup fit deepsdf", SAMPLES: "surfsup fit deepsdf"}


def write(path: Path, kind: str, header: dict[str, Any], tensors: dict[str, Tensor]) -> None:
    """Write ``tensors`` and what ``header`` says of them; a file that is there is replaced when all is written.

    Raises:
        InputError: the disk is full or not writable.
    """
    partial = path.with_name(path.name + ".partial")
    metadata = {"format": kind, "surface": json.dumps(header)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_file({name: value.contiguous() for name, value in tensors.items()}, partial, metadata)
        partial.replace(path)
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: cannot be written ({error})") from None


def kind_of(path: Path) -> str:
    """The format of the neural surface in ``path``.

    Raises:
        InputError: the file is missing, cut off, or holds something else.
    """
    found = metadata_of(path).get("format", "something else")
    if found not in (SIREN, DEEPSDF):
        raise InputError(
            f"{path}: holds '{found}', no neural surface; make one with '{VERBS[SIREN]}' or '{VERBS[DEEPSDF]}'"
        )
    return found


def read(path: Path, kind: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """What is known of the surface in ``path``, which must be of ``kind``, and its tensors.

    Raises:
        InputError: the file is missing, cut off, of another kind, or its header is damaged.
    """
    metadata = metadata_of(path)
    if metadata.get("format") != kind:
        raise InputError(
            f"{path}: holds '{metadata.get('format', 'something else')}', not '{kind}'; make one with '{VERBS[kind]}'"
        )
    try:
        with safe_open(path, framework="pt") as file:
            names = file.keys()  # the file itself is no mapping
            tensors = {name: file.get_tensor(name) for name in names}
        header = json.loads(metadata["surface"])
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: its header or its tensors are damaged ({short(error)})") from None
    if not all(bool(torch.isfinite(tensor).all()) for tensor in tensors.values()):
        raise InputError(f"{path}: has numbers that are not finite (NaN or infinity); fit it again")
    if not isinstance(header, dict):
        raise InputError(f"{path}: its header is damaged (it is no mapping)")
    return header, tensors


def metadata_of(path: Path) -> dict[str, str]:
    """The texts in the file's header.

    Raises:
        InputError: the file is missing, cut off, or not safetensors.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file of a neural surface")
    try:
        with safe_open(path, framework="pt") as file:
            return file.metadata() or {}
    except SafetensorError as error:
        raise InputError(
            f"{path}: is cut off or not a safetensors file ({short(error)}); pickled weights are refused"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def misfit(path: Path, error: Exception) -> InputError:
    """The complaint that the tensors of ``path`` are not those of its architecture."""
    return InputError(f"{path}: its tensors do not fit its architecture ({short(error)})")


def part(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose name starts with ``prefix``, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def short(error: Exception) -> str:
    """The message of ``error`` on a line."""
    return " ".join(str(error).split())[:120]
