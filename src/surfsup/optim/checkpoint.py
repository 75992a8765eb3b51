"""Checkpoints of a run: tensors and a JSON header in a safetensors file; the last two are kept."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from surfsup.checked.tensors import read_tensors
from surfsup.errors import InputError, single_line

FORMAT = "surfsup-checkpoint-3"


@dataclass(frozen=True)
class Checkpoint:
    """Everything that a run needs to continue.

    Attributes:
        tensors: weights, averaged weights and optimizer state, by name.
        counters: numbers and other JSON values.
        config: the configuration of the run, as JSON.
    """

    tensors: dict[str, Tensor]
    counters: dict[str, Any]
    config: str


class CheckpointFiles:
    """The last checkpoint in the folder of a run and the one before it.

    Attributes:
        last, previous: their paths.
    """

    def __init__(self, folder: Path) -> None:
        self.last = folder / "checkpoint.safetensors"
        self.previous = folder / "checkpoint-before.safetensors"
        self._last_is_valid = True

    def exist(self) -> bool:
        """Whether there is a checkpoint."""
        return self.last.exists() or self.previous.exists()

    def save(self, checkpoint: Checkpoint) -> None:
        """Write a checkpoint. A kill or a power cut at any moment leaves at least one complete file.

        Raises:
            InputError: the disk is full or not writable; existing checkpoints stay as they are.
        """
        partial = self.last.with_suffix(".partial")
        header = {"format": FORMAT, "run": json.dumps(checkpoint.counters), "config": checkpoint.config}
        try:
            save_file({name: value.contiguous() for name, value in checkpoint.tensors.items()}, partial, header)
            with partial.open("rb") as written:
                os.fsync(written.fileno())
            if self._last_is_valid and self.last.exists():
                self.last.replace(self.previous)
            partial.replace(self.last)
            self._last_is_valid = True
        except (OSError, SafetensorError) as error:
            raise InputError(f"{self.last}: cannot be written ({error})") from None

    def load(self) -> Checkpoint:
        """Read the last checkpoint; if that is damaged, warn and read the previous one.

        Raises:
            InputError: there is no checkpoint, or none that is complete and of this version.
        """
        if not self.exist():
            raise InputError(f"{self.last}: there is no checkpoint to resume")
        try:
            return read(self.last)
        except InputError as error:
            if not self.previous.exists():
                raise
            checkpoint = read(self.previous)
            self._last_is_valid = False  # the damaged file must not replace the previous one
            step = checkpoint.counters.get("step")
            warnings.warn(f"{error}; resuming from the previous one, at step {step}", stacklevel=2)
            return checkpoint


def read(path: Path) -> Checkpoint:
    """Read the checkpoint in the file ``path``.

    Raises:
        InputError: the file is missing, cut off, not a checkpoint, or of another version.
    """
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
        counters, config = json.loads(header["run"]), header["config"]
        if header.get("format") != FORMAT:
            raise InputError(
                f"{path}: is a checkpoint of another version of surfsup, which this one cannot resume; "
                "start a new run in another folder"
            )
        if not isinstance(counters, dict):
            raise ValueError("its counters are no mapping")
        return Checkpoint(read_tensors(path), counters, config)
    except InputError:
        raise
    except (SafetensorError, OSError, KeyError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: is cut off or no checkpoint ({summary(error)})") from None


def with_prefix(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors under names that start with ``prefix``."""
    return {prefix + name: value for name, value in tensors.items()}


def without_prefix(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names start with ``prefix``, under the rest of their names."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def optimizer_state(optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """The state of an optimizer as tensors named ``<parameter number>.<state name>``."""
    states: dict[int, dict[str, Tensor]] = optimizer.state_dict()["state"]
    return {f"{number}.{name}": value for number, state in states.items() for name, value in state.items()}


def load_optimizer_state(optimizer: torch.optim.Optimizer, tensors: Mapping[str, Tensor]) -> None:
    """Restore what :func:`optimizer_state` returned.

    Raises:
        ValueError: a tensor belongs to no parameter of the optimizer, has none of the shapes that a state has, or has
            numbers that the parameter's precision cannot hold.
    """
    parameters = [parameter for group in optimizer.param_groups for parameter in group["params"]]
    states: dict[int, dict[str, Tensor]] = {}
    for name, value in tensors.items():
        number, key = name.split(".", 1)
        shape = parameters[int(number)].shape if 0 <= int(number) < len(parameters) else None
        square = value.ndim == 2 and value.shape[0] == value.shape[1] and shape is not None and value.shape[0] in shape
        if shape is None or not value.is_floating_point() or not (value.ndim == 0 or value.shape == shape or square):
            raise ValueError(f"its tensor 'optimizer.{name[:80]}' fits no parameter")
        if not bool(torch.isfinite(value.to(parameters[int(number)].dtype)).all()):
            raise ValueError(f"its tensor 'optimizer.{name[:80]}' has numbers that are not finite in single precision")
        states.setdefault(int(number), {})[key] = value
    optimizer.load_state_dict({"state": states, "param_groups": optimizer.state_dict()["param_groups"]})


def summary(error: Exception) -> str:
    """The message of ``error`` on one short line."""
    return single_line(error)[:120]
