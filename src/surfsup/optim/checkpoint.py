"""The checkpoint of a run: tensors and a JSON header, of which the last two are kept."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from surfsup.errors import InputError


@dataclass(frozen=True)
class Checkpoint:
    """All that a run needs to go on.

    Attributes:
        tensors: weights, averages and the optimizer's.
        counters: numbers that go with them.
        config: of the run, as JSON.
    """

    tensors: dict[str, Tensor]
    counters: dict[str, Any]
    config: str


class CheckpointFiles:
    """The last checkpoint of a run and the one before it."""

    def __init__(self, folder: Path) -> None:
        self.last = folder / "checkpoint.safetensors"
        self.before = folder / "checkpoint-before.safetensors"
        self._last_is_whole = True

    def exist(self) -> bool:
        """Whether there is one to go on from."""
        return self.last.exists() or self.before.exists()

    def save(self, checkpoint: Checkpoint) -> None:
        """Write the checkpoint, so that a kill or a power cut at any moment leaves a whole one.

        Raises:
            InputError: the disk is full or not writable; the checkpoints that were there still are.
        """
        partial = self.last.with_suffix(".partial")
        header = {"run": json.dumps(checkpoint.counters), "config": checkpoint.config}
        try:
            save_file({name: value.contiguous() for name, value in checkpoint.tensors.items()}, partial, header)
            with partial.open("rb") as written:
                os.fsync(written.fileno())
            if self._last_is_whole and self.last.exists():
                self.last.replace(self.before)
            partial.replace(self.last)
            self._last_is_whole = True
        except (OSError, SafetensorError) as error:
            raise InputError(f"{self.last}: cannot be written ({error})") from None

    def load(self) -> Checkpoint:
        """The last checkpoint; where it is damaged, with a warning, the one before it.

        Raises:
            InputError: there is none, or none that is whole.
        """
        if not self.exist():
            raise InputError(f"{self.last}: there is no checkpoint to resume")
        try:
            return read(self.last)
        except InputError as error:
            if not self.before.exists():
                raise
            checkpoint = read(self.before)
            self._last_is_whole = False  # it must not take the other's place
            step = checkpoint.counters.get("step")
            warnings.warn(f"{error}; going on from the one before it, at step {step}", stacklevel=2)
            return checkpoint


def read(path: Path) -> Checkpoint:
    """The checkpoint in the file ``path``.

    Raises:
        InputError: it is missing, cut off, or no checkpoint.
    """
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
        return Checkpoint(load_file(path), json.loads(header["run"]), header["config"])
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: is cut off or no checkpoint ({reason})") from None
