"""``dataset.yaml``: the identity of a data set, its size, and its statistics for normalization."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import yaml

from surfsup import __version__
from surfsup.datasets.folder import atomic_write
from surfsup.datasets.generation.record import GenerationRecord
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.generation.statistics import normalization_statistics
from surfsup.errors import InputError
from surfsup.scene.safe_yaml import parse_yaml
from surfsup.splishsplash import solver

NAME = "dataset.yaml"
MAX_BYTES = 20_000_000  # of it; a million scenes that were rejected


@dataclass(frozen=True)
class DatasetIdentity:
    """The properties that all scenes in a data set's folder share.

    Attributes:
        recipe: name of the recipe.
        seed: of the data set.
        frames: of every scene, None for the recipe's own.
        source: file or folder that the recipe takes its surfaces from, None if it makes its own.
    """

    recipe: str
    seed: int
    frames: int | None
    source: str | None

    @classmethod
    def of(cls, sampler: SceneSampler, source: Path | None) -> DatasetIdentity:
        """The identity of a data set with this sampler and source."""
        return cls(sampler.recipe, sampler.seed, sampler.frames, None if source is None else str(source.resolve()))

    def __str__(self) -> str:
        """As error messages show it."""
        frames = f", {self.frames} frames" if self.frames is not None else ""
        source = f", made of {self.source}" if self.source is not None else ""
        return f"recipe '{self.recipe}' of seed {self.seed}{frames}{source}"


def check_identity(folder: Path, expected: DatasetIdentity) -> None:
    """Check that ``folder`` is new or holds the ``expected`` data set.

    Raises:
        InputError: it holds another data set, or its ``dataset.yaml`` does not identify one.
    """
    path = folder / NAME
    if not path.exists():
        return
    if not path.is_file() or path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path}: is no plain file, or too large for one that describes data; take another folder")
    found = parse_yaml(path.read_text(errors="replace"), str(path))
    if not isinstance(found, dict) or not {"recipe", "seed"} <= found.keys():
        raise InputError(f"{path}: does not say what data the folder holds; take another folder")
    held = DatasetIdentity(found["recipe"], found["seed"], found.get("frames"), found.get("source"))
    if held != expected and held == replace(expected, frames=held.frames):
        held_frames = "the recipe's own number of" if held.frames is None else held.frames
        remedy = "leave out --frames" if held.frames is None else f"give --frames {held.frames}"
        raise InputError(f"{folder}: holds scenes of {held_frames} frames; {remedy}, or take another folder")
    if held != expected:
        raise InputError(f"{folder}: holds {held}; take another folder for {expected}")


def write_dataset_file(folder: Path, identity: DatasetIdentity, scenes: Sequence[GenerationRecord]) -> None:
    """Write ``dataset.yaml`` for the ``scenes`` in the folder, in the order of their indices.

    The result depends on the scenes alone, not on the order of their simulation.
    """
    data: dict[str, object] = {name: value for name, value in vars(identity).items() if value is not None}
    data["versions"] = {
        "surfsup": sorted({scene.version for scene in scenes}) or [__version__],
        "solver": sorted({scene.solver for scene in scenes}) or [solver.NAME],
    }
    particles = [scene.particles for scene in scenes]
    data["scenes"] = len(scenes)
    data["frames_in_all"] = sum(scene.frames for scene in scenes)
    if scenes:
        data["particles"] = {"fewest": min(particles), "most": max(particles), "in_all": sum(particles)}
    data["rejected"] = [
        {"scene": scene.index, "attempt": attempt, "reason": reason}
        for scene in scenes
        for attempt, reason in enumerate(scene.rejections)
    ]
    if scenes:
        data["statistics"] = normalization_statistics(scene.moments for scene in scenes)
    with atomic_write(folder / NAME) as path:
        path.write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=120))
