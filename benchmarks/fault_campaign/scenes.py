"""Scene files: unusual ones that run, hostile values, keys lost or misspelled, and damaged text."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fault_campaign import damage
from fault_campaign.inputs import QUIET, Inputs
from fault_campaign.soundness import unsound
from fault_campaign.unusual import unusual_scene
from fault_campaign.verdict import Case

WATER = {"block": {"min": [-0.1, -0.1, 0.5], "max": [0.1, 0.1, 0.7]}}
POOL = {"block": {"min": [-0.28, -0.28, 0.02], "max": [0.28, 0.28, 0.14]}}
BOX = {"size": [0.6, 0.6, 0.9]}
# One of every key that a scene file has.
SCENES: dict[str, dict[str, Any]] = {
    "sphere": {"container": BOX, "surface": {"sphere": {"radius": 0.1}, "at": [0, 0, 0.2]}, "fluid": [WATER]},
    "turned": {
        "container": BOX,
        "surface": {"box": {"size": [0.3, 0.2, 0.1]}, "rotate": {"axis": [1, 0, 0], "degrees": 30}, "at": [0, 0, 0.2]},
        "fluid": [WATER],
        "gravity": [0, 0, -9.81],
    },
    "cut": {
        "container": BOX,
        "surface": {"difference": [{"box": {"size": [0.5, 0.5, 0.1]}}, {"sphere": {"radius": 0.1}}], "at": [0, 0, 0.2]},
        "fluid": [WATER],
        "particle_radius": 0.02,
    },
    "mesh": {"container": BOX, "surface": {"mesh": {"file": "ball.stl", "fit": 0.3}}, "fluid": [WATER]},
    "moving": {
        "container": BOX,
        "surfaces": {
            "paddle": {
                "box": {"size": [0.3, 0.05, 0.1]},
                "at": [0, 0, 0.2],
                "motion": {"spin": {"axis": [0, 0, 1], "turns": 1}},
            }
        },
        "fluid": [POOL],
        "forces": "all",
    },
    "keyframes": {
        "container": BOX,
        "surfaces": {
            "ball": {
                "sphere": {"radius": 0.08},
                "motion": {"keyframes": [{"time": 0, "position": [0, 0, 0.6]}, {"time": 1, "position": [0, 0, 0.3]}]},
            }
        },
        "fluid": [POOL],
    },
    "tap": {
        "container": BOX,
        "fluid": [],
        "taps": [{"disc": {"radius": 0.05}, "at": [0, 0, 0.6], "direction": [0, 0, -1], "speed": 1.0}],
        "drains": [{"box": {"size": [0.2, 0.2, 0.1]}, "at": [0, 0, 0.05]}],
        "fps": 50,
        "duration": 0.05,
    },
    "floating": {
        "container": BOX,
        "surfaces": {"boat": {"box": {"size": [0.2, 0.2, 0.1]}, "at": [0, 0, 0.3], "rigid_body": {"density": 400}}},
        "fluid": [POOL],
    },
    "filled": {
        "container": BOX,
        "surface": {"bowl": {"capture_radius": 0.2, "filter_radius": 0}, "at": [0, 0, 0.3]},
        "fluid": [{"fill": {"below": 0.2}}],
    },
    "particles": {"container": BOX, "fluid": [{"particles": {"file": "data/00000.h5", "frame": 0}}]},
}
HOSTILE: tuple[Any, ...] = (
    1e39, -1e39, 1e300, float("nan"), float("inf"), 0, -1, 1e-320, 10**30, "", " ", None, True, [], {}, [[[]]],
    "x" * 5000,
    "\x1b[2J", "a\u202eb", "a\x00b", "../../../etc/passwd", "/dev/zero", "/dev/stdin", "pipe", "loop", "folder", "1e5",
    "0x1F", [0, 0], [0, 0, 0], [1e39, 0, 0], [1e30, 1e30, 1e30], {"a": 1}, "!!python/object:os.system", 2.5, 1e9, 1e-9,
)  # fmt: skip


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths of all values in a tree."""
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield (*path, key)
        yield from places(value[key], (*path, key))


def at(tree: Any, path: tuple[Any, ...]) -> Any:
    """The value at a path."""
    for key in path:
        tree = tree[key]
    return tree


def replaced(tree: dict[str, Any], random: np.random.Generator) -> tuple[str, dict[str, Any]]:
    """A scene with one or two values replaced, lost or under another key."""
    changed, names = copy.deepcopy(tree), []
    for _ in range(int(random.integers(1, 3))):
        everywhere = list(places(changed))
        path = everywhere[int(random.integers(len(everywhere)))]
        parent, key = at(changed, path[:-1]), path[-1]
        action = int(random.integers(10))
        if action == 0:
            del parent[key]
        elif action == 1 and isinstance(parent, dict):
            parent[f"{key}x"] = parent.pop(key)
        else:
            parent[key] = HOSTILE[int(random.integers(len(HOSTILE)))]
        names.append(".".join(map(str, path)))
    return " ".join(names), changed


def cases(random: np.random.Generator, count: int, inputs: Inputs) -> Iterator[Case]:
    """Four of six are unusual but valid, one has hostile values, one is damaged text."""
    kinds = list(SCENES)
    for number in range(count):
        own = np.random.default_rng(random.integers(1 << 62))
        kind = kinds[number % len(kinds)]
        tree = {"frames": 3, **SCENES[kind]} if kind != "tap" else SCENES[kind]
        if number % 6 < 4:
            name, changed = unusual_scene(own)
            yield case(f"unusual {number}: {name}", yaml.safe_dump(changed).encode(), inputs)
            continue
        if number % 6 == 4:
            name, changed = replaced(tree, own)
            data = yaml.safe_dump(changed, allow_unicode=True).encode("utf-8", "surrogatepass")
        else:
            damages = (*damage.TEXT, damage.cut, damage.flip_bits, damage.drop, damage.repeat, damage.insert)
            one = damages[int(own.integers(len(damages)))]
            name, data = one.__name__, one(yaml.safe_dump(tree).encode(), own)
        yield case(f"{kind} {name} {number}", data, inputs, ("--frames", 3) * (b"duration" not in data))


def case(name: str, data: bytes, inputs: Inputs, frames: tuple[object, ...] = ()) -> Case:
    """The simulation of the scene."""
    arguments = ["simulate", "scene.yaml", "-o", "out", *frames, *QUIET]
    return Case("scene", name, arguments, partial(prepare, data, inputs), unsound, "scene.yaml")


def prepare(data: bytes, inputs: Inputs, folder: Path) -> None:
    """The scene, the files that it names, and some that it should not."""
    (folder / "scene.yaml").write_bytes(data)
    (folder / "ball.stl").symlink_to(inputs.mesh)
    (folder / "data").symlink_to(inputs.data)
    (folder / "folder").mkdir()
    (folder / "loop").symlink_to("loop")
    os.mkfifo(folder / "pipe")
