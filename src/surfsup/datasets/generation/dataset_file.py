"""``dataset.yaml``: what a data set is, of what it was made, and the statistics to normalize by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from surfsup import __version__
from surfsup.datasets.folder import whole_file
from surfsup.datasets.generation.record import Made
from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.generation.statistics import normalization
from surfsup.errors import InputError
from surfsup.scene.safe_yaml import parse_yaml
from surfsup.splishsplash import solver

NAME = "dataset.yaml"


@dataclass(frozen=True)
class Identity:
    """What may never change in a data set's folder.

    Attributes:
        recipe: which scenes.
        seed: of the data set.
        frames: of every scene, None where the recipe says it.
        source: what the recipe makes surfaces of, None where it makes its own.
    """

    recipe: str
    seed: int
    frames: int | None
    source: str | None

    @classmethod
    def of(cls, drawing: Drawing, source: Path | None) -> Identity:
        """That of scenes drawn in this way."""
        return cls(drawing.recipe, drawing.seed, drawing.frames, None if source is None else str(source.resolve()))

    def __str__(self) -> str:
        """As a complaint names it."""
        frames = f", {self.frames} frames" if self.frames is not None else ""
        source = f", made of {self.source}" if self.source is not None else ""
        return f"recipe '{self.recipe}' of seed {self.seed}{frames}{source}"


def check_identity(folder: Path, wanted: Identity) -> None:
    """Check that ``folder`` is new or holds just what is ``wanted``.

    Raises:
        InputError: it holds something else, or does not say what it holds.
    """
    path = folder / NAME
    if not path.exists():
        return
    found = parse_yaml(path.read_text(errors="replace"), str(path))
    if not isinstance(found, dict) or not {"recipe", "seed"} <= found.keys():
        raise InputError(f"{path}: does not say what data the folder holds; take another folder")
    held = Identity(found["recipe"], found["seed"], found.get("frames"), found.get("source"))
    if held != wanted:
        raise InputError(f"{folder}: holds {held}; take another folder for {wanted}")


def describe(folder: Path, identity: Identity, scenes: Sequence[Made]) -> None:
    """Write ``dataset.yaml``; ``scenes`` are those in the folder, in their order.

    It depends on the scenes alone, not on the order in which they were made.
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
    data["set_aside"] = [
        {"scene": scene.index, "attempt": attempt, "reason": reason}
        for scene in scenes
        for attempt, reason in enumerate(scene.set_aside)
    ]
    if scenes:
        data["statistics"] = normalization(scene.sums for scene in scenes)
    with whole_file(folder / NAME) as path:
        path.write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=120))
