"""Unusual but valid scenes: values at the ends of what is allowed, small rooms, and everything beside everything.

These run, so their results are evaluated. Lengths below are those of particles of 15 mm; a scene with others is larger
or smaller as a whole.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from fault_campaign.inputs import LENGTH

Tree = dict[str, Any]
RADII = (0.001, 0.0013, 0.0037, 0.0149, 0.015, 0.02, 0.0333, 0.06, 0.1)
GRAVITIES = ([0, 0, 0], [0, 0, 9.81], [9.81, 0, 0], [0, 0, -1e-6], [3, -4, -30], [0, 0, -100])


def unusual_scene(random: np.random.Generator) -> tuple[str, Tree]:
    """A scene of some 30 to 600 particles and a few frames, and what is in it."""
    length = (radius := pick(random, RADII)) / LENGTH
    size = [float(side) for side in random.uniform(0.15, 0.8, 3)]
    tree: Tree = {"container": {"size": lengths(size, length)}, "particle_radius": radius}
    tree["frames"] = int(random.integers(2, 13))
    parts = [
        still(random, tree, size, length) if random.random() < 0.5 else moving(random, tree, size, length),
        water(random, tree, size, length),
    ]
    extras = (pull, liquid, walls, open_water, rate, impulses)
    for number in random.permutation(len(extras))[: int(random.integers(0, 4))]:
        parts.append(extras[number](random, tree, size, length))
    return " ".join(filter(None, parts)), json.loads(json.dumps(tree))  # YAML would mark what occurs twice


def pick(random: np.random.Generator, choices: Any) -> Any:
    """One of some choices."""
    return choices[int(random.integers(len(choices)))]


def lengths(values: Any, length: float) -> list[float]:
    """Meters."""
    return [round(float(value) * length, 7) for value in values]


def shape(random: np.random.Generator, length: float) -> tuple[str, Tree]:
    """A solid of any kind, thin, thick, tiny, large, turned, scaled or mirrored in itself."""
    one = float(random.uniform(0.02, 0.3))
    thin = float(pick(random, (0.0002, 0.003, 0.02, 0.1)))
    ball: Tree = {"sphere": {"radius": one * length}}
    brick: Tree = {"box": {"size": lengths((one, one, thin), length)}}
    shapes: dict[str, Tree] = {
        "ball": ball,
        "speck": {"sphere": {"radius": 0.001 * length}},
        "plate": {"box": {"size": lengths((2, 2, thin), length)}},
        "brick": brick,
        "needle": {"cylinder": {"radius": thin * length, "height": 0.3 * length}},
        "cone": {"cone": {"height": one * length, "bottom_radius": 0.2 * length, "top_radius": 1e-4 * length}},
        "ring": {"torus": {"major_radius": one * length, "minor_radius": min(thin, 0.9 * one) * length}},
        "bowl": {"bowl": {"capture_radius": (0.1 + one) * length, "filter_radius": 0, "wall": thin * length}},
        "funnel": {
            "funnel": {"capture_radius": (0.1 + one) * length, "filter_radius": 0.05 * length, "wall": thin * length}
        },
        "touching": {"union": [brick, {**brick, "at": lengths((0, 0, thin), length)}]},
        "bitten": {"difference": [{"box": {"size": lengths((0.3, 0.3, 0.1), length)}}, ball]},
        "lens": {"intersection": [ball, {**ball, "at": lengths((0.5 * one, 0, 0), length)}]},
        "mesh": {"mesh": {"file": "ball.stl", "fit": one * length}},
    }
    name = pick(random, list(shapes))
    tree = dict(shapes[name])
    if random.random() < 0.4:
        tree["rotate"] = {
            "axis": direction(random),
            "degrees": float(random.uniform(-400, 400)),
        }
    if random.random() < 0.2:
        tree["scale"] = pick(random, (0.05, 0.5, 3.0))
    return name, tree


def place(random: np.random.Generator, size: list[float], length: float) -> list[float]:
    """Anywhere in the room, in its walls or outside."""
    return lengths(random.uniform((-0.6, -0.6, -0.1), (0.6, 0.6, 0.7)) * size, length)


def still(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """A solid that stands still, or none."""
    if random.random() < 0.1:
        return "empty"
    name, solid = shape(random, length)
    tree["surface"] = {**solid, "at": place(random, size, length)}
    return name


def moving(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """One or two solids that turn, jump or float."""
    names, tree["surfaces"] = [], {}
    for number in range(int(random.integers(1, 3))):
        name, solid = shape(random, length)
        solid["at"] = place(random, size, length)
        how = pick(random, ("spin", "keyframes", "rigid_body", "still"))
        if how == "spin":
            axis = direction(random)
            solid["motion"] = {"spin": {"axis": axis, "turns": float(random.uniform(-8, 8)) / length**0.5}}
        elif how == "keyframes":
            times = np.cumsum(random.uniform(0.004, 0.05, 3)) * length**0.5
            keys = [{"time": float(time), "position": place(random, size, length)} for time in times]
            solid["motion"] = {"keyframes": keys, "between": pick(random, ("smooth", "linear"))}
        elif how == "rigid_body":
            solid["at"] = lengths(random.uniform((-0.2, -0.2, 0.4), (0.2, 0.2, 0.6)) * size, length)
            solid["rigid_body"] = {"density": pick(random, (5, 100, 500, 1000, 20000))}
            solid["flush"] = False
        tree["surfaces"][f"{name}-{number}"] = solid
        names.append(f"{name}/{how}")
    return "+".join(names)


def water(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """A block or two of 2 to 9 particles along each side, at rest or thrown."""
    tree["fluid"] = []
    for _ in range(int(random.integers(1, 3))):
        sides = np.minimum(random.integers(2, 10, 3) * 0.03 + 0.001, np.subtract(size, 0.05))
        lower = random.uniform((-0.5, -0.5, 0) + 0.02 / np.array(size), (0.5, 0.5, 1) - (sides + 0.02) / size) * size
        block: Tree = {"min": lengths(lower, length), "max": lengths(lower + sides, length)}
        if random.random() < 0.4:
            speed = pick(random, (0.1, 3, 30, 60)) * length**0.5
            block["velocity"] = [speed * part for part in direction(random)]
        tree["fluid"].append({"block": block})
    return f"{len(tree['fluid'])} blocks"


def direction(random: np.random.Generator) -> list[float]:
    """Three numbers of length 1."""
    vector = random.normal(size=3)
    return [float(part) for part in vector / np.linalg.norm(vector)]


def pull(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """Gravity that is none, sideways, upward or strong."""
    tree["gravity"] = pick(random, GRAVITIES)
    return f"gravity {tree['gravity']}"


def liquid(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """Another liquid: by name, or thick, sticky and light beyond all that exists."""
    tree["liquid"] = pick(
        random,
        (
            "honey",
            "water",
            {"viscosity": 0},
            {"viscosity": 100.0},
            {"viscosity": 1e-9, "surface_tension": 1.0},
            {"surface_tension": 10.0 * length**2, "adhesion": 10.0 * length**2},
            {"viscosity": 0.1, "friction": 0, "density": 1.0},
            {"density": 1e5},
        ),
    )
    return f"liquid {tree['liquid']}"


def walls(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """No walls, or walls that turn."""
    if random.random() < 0.5:
        tree["container"] = "none"
        return "open"
    turns = float(random.uniform(-3, 3)) / length**0.5
    tree["container"]["motion"] = {"spin": {"axis": direction(random), "turns": turns}}
    return "walls/spin"


def open_water(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """A tap, and often a drain."""
    side = float(random.uniform(0.06, 0.1))
    tap: Tree = {"at": lengths((0, 0, 0.7 * size[2]), length), "direction": direction(random)}
    tap.update(
        pick(random, ({"disc": {"radius": side * length}}, {"rectangle": {"size": lengths((side, side), length)}}))
    )
    tap["speed"] = pick(random, (0.01, 1.0, 10.0)) * length**0.5
    tree["taps"] = [tap]
    if random.random() < 0.6:
        tree["drains"] = [{"box": {"size": lengths((2, 2, 0.2), length)}}]
    return "tap" + "+drain" * ("drains" in tree)


def rate(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """Frames of another length than the simulator's."""
    tree["fps"] = float(pick(random, (7.3, 30, 60, 199.9))) / length**0.5
    tree["frames"] = 2 if tree["fps"] * length**0.5 < 20 else tree["frames"]
    return f"{tree['fps']:.4g} fps"


def impulses(random: np.random.Generator, tree: Tree, size: list[float], length: float) -> str:
    """The forces on all solids."""
    tree["forces"] = "all"
    return "forces"
