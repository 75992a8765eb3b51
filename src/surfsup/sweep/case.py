"""The cases of a sweep: every scene with every combination of the varied values."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.sweep.variation import MAX_CASES, Value, Variation, replaced


@dataclass(frozen=True)
class Case:
    """One simulation of a sweep.

    Attributes:
        name: of its folder: that of the scene and a number.
        scene_name: name of the scene that it varies.
        values: the varied values by key.
        text: the scene as YAML; paths in it are absolute.
    """

    name: str
    scene_name: str
    values: Mapping[str, Value]
    text: str

    @property
    def scene(self) -> Scene:
        """The scene to simulate."""
        return Scene.from_yaml(self.text, self.name)

    @property
    def digest(self) -> str:
        """A hash of the scene, by which a later run recognizes it."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]


def cases_of(scenes: Mapping[str, Scene], variations: Sequence[Variation]) -> list[Case]:
    """Every scene with every combination of the values.

    Raises:
        InputError: a key is unknown or given twice, a value is out of range, or there are too many cases.
    """
    keys = [variation.key for variation in variations]
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InputError(f"--vary {twice}: is given twice; list all its values in one, as in {twice}=1,2,3")
    count = len(scenes)
    for variation in variations:
        count *= len(variation.values)
    if count > MAX_CASES:
        raise InputError(f"--vary: makes {count} cases, but {MAX_CASES} are the most; give fewer values")
    combinations = list(itertools.product(*(variation.values for variation in variations)))
    digits = len(str(len(combinations) - 1))
    return [
        case_of(f"{name}-{number:0{digits}d}", name, scene, dict(zip(keys, values, strict=True)))
        for name, scene in scenes.items()
        for number, values in enumerate(combinations)
    ]


def case_of(name: str, scene_name: str, scene: Scene, values: Mapping[str, Value]) -> Case:
    """The scene with other values, checked as a scene file is."""
    description = full_description(scene)
    for key, value in values.items():
        description = replaced(description, key, value, scene_name)
    given = ", ".join(f"{key}={value}" for key, value in values.items())
    text = yaml.safe_dump(description, sort_keys=False, default_flow_style=None)
    varied = Scene.from_yaml(text, f"{scene_name} with {given}" if given else scene_name)
    return Case(name, scene_name, values, varied.to_yaml())


def full_description(scene: Scene) -> Any:
    """A scene as nested mappings and lists, defaults included, so that every key can be varied."""
    nowhere = Path("/nonexistent")  # no file lies here, so every path becomes absolute
    parsed = Scene.from_yaml(scene.with_paths_relative_to(nowhere).to_yaml(), "scene")
    description = parsed.model_dump(mode="json", exclude_none=True)
    if parsed.duration is not None:
        del description["frames"]  # follows from the duration
    return description
