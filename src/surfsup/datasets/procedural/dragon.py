"""A dragon that sits on the floor with raised wings, for honey to run over.

It faces -y. The functions are named after the parts of the animal. ``examples/dragon.obj`` is this dragon:

    from surfsup.datasets.procedural.dragon import dragon, simplified
    simplified(dragon(), 9000).export("examples/dragon.obj", digits=4)
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from surfsup.datasets.procedural.sculpting import Point, SculptureGrid

if TYPE_CHECKING:
    import trimesh

CELL = 0.007  # meters
SIDES = (-1.0, 1.0)
SPINE: list[Point] = [  # from the neck to the tail, along the back
    (0.0, -0.32, 0.68),
    (0.0, -0.25, 0.62),
    (0.0, -0.25, 0.53),
    (0.0, -0.24, 0.44),
    (0.0, -0.16, 0.40),
    (0.0, -0.06, 0.39),
    (0.0, 0.05, 0.38),
    (0.0, 0.15, 0.36),
    (0.0, 0.25, 0.31),
]


def dragon() -> trimesh.Trimesh:
    """The dragon as closed triangles in meters, 1.2 from snout to tail, standing on z = 0."""
    sculpture = SculptureGrid((-0.6, -0.6, 0.0), (0.6, 0.75, 0.95), CELL)
    body(sculpture)
    tail(sculpture)
    legs(sculpture)
    wings(sculpture)
    head(sculpture)
    return sculpture.to_mesh()


def body(sculpture: SculptureGrid) -> None:
    """Trunk, the curved neck, and a crest down the back."""
    sculpture.add_tube([(0, 0.2, 0.23), (0, 0.0, 0.26), (0, -0.15, 0.29)], [0.12, 0.125, 0.125], blend=0.05)
    sculpture.add_tube(
        [(0, -0.17, 0.31), (0, -0.28, 0.4), (0, -0.32, 0.5), (0, -0.3, 0.6), (0, -0.34, 0.68)],
        [0.105, 0.08, 0.066, 0.06, 0.055],
        blend=0.05,
    )
    for low, high in pairwise(SPINE):
        for part in (0.25, 0.75):
            foot = (1 - part) * np.array(low) + part * np.array(high)
            back = np.array(high) - np.array(low)
            up = np.array([0.0, -back[2], back[1]]) / np.linalg.norm(back)
            peak = foot + 0.055 * up + 0.25 * back
            sculpture.add_tube([as_point(foot - 0.03 * up), as_point(peak)], [0.026, 0.006], blend=0.012)


def tail(sculpture: SculptureGrid) -> None:
    """A tail around the left side, with a spade at its end."""
    turns = np.linspace(0.0, 1.0, 16)
    ends: list[Point] = [
        (0.42 * float(np.sin(2.6 * t)), 0.3 + 0.3 * float(np.sin(3.0 * t)) - 0.28 * t**2, 0.04 + 0.18 * (1 - t) ** 2)
        for t in turns
    ]
    radii = [0.1 - 0.082 * t**0.7 for t in turns]
    sculpture.add_tube(ends, radii, blend=0.04)
    for at, radius in list(zip(ends, radii, strict=True))[1:-3]:
        x, y, z = at
        sculpture.add_tube([at, (x, y + 0.02, z + radius + 0.035)], [0.024, 0.006], blend=0.012)
    tip, direction = np.array(ends[-1]), np.array(ends[-1]) - np.array(ends[-2])
    along = direction / np.linalg.norm(direction)
    across = np.cross(along, (0.0, 0.0, 1.0))
    for side in SIDES:
        wide = as_point(tip + 0.05 * along + 0.04 * side * across)
        sculpture.add_tube([ends[-1], wide, as_point(tip + 0.15 * along)], [0.02, 0.018, 0.012], blend=0.015)


def legs(sculpture: SculptureGrid) -> None:
    """Strong thighs, forelegs, and feet with three claws."""
    for side in SIDES:
        sculpture.add_ellipsoid((side * 0.13, 0.17, 0.19), (0.08, 0.13, 0.13), blend=0.04)
        sculpture.add_tube(
            [(side * 0.17, 0.1, 0.15), (side * 0.18, 0.2, 0.08), (side * 0.18, 0.1, 0.045)],
            [0.06, 0.045, 0.04],
            blend=0.02,
        )
        foot(sculpture, (side * 0.18, 0.08, 0.035))
        sculpture.add_ellipsoid((side * 0.11, -0.14, 0.26), (0.065, 0.09, 0.11), blend=0.04)
        sculpture.add_tube(
            [(side * 0.14, -0.13, 0.22), (side * 0.16, -0.09, 0.12), (side * 0.15, -0.18, 0.045)],
            [0.055, 0.045, 0.036],
            blend=0.02,
        )
        foot(sculpture, (side * 0.15, -0.2, 0.035))


def foot(sculpture: SculptureGrid, at: Point) -> None:
    """A foot with three toes that end in claws."""
    x, y, z = at
    sculpture.add_ellipsoid(at, (0.055, 0.06, 0.035), blend=0.02)
    for toe in (-1.0, 0.0, 1.0):
        knuckle = (x + 0.035 * toe, y - 0.06, z - 0.005)
        sculpture.add_tube([at, knuckle, (x + 0.05 * toe, y - 0.115, 0.012)], [0.025, 0.022, 0.009], blend=0.01)


def wings(sculpture: SculptureGrid) -> None:
    """Raised wings: an arm, four fingers, and the skin between them, lower between the tips."""
    for side in SIDES:
        shoulder, elbow, wrist = (side * 0.07, -0.06, 0.36), (side * 0.23, 0.02, 0.52), (side * 0.31, -0.08, 0.7)
        sculpture.add_tube([shoulder, elbow, wrist], [0.045, 0.034, 0.026], blend=0.025)
        tips = np.array(
            [
                (side * 0.5, 0.12, 0.86),
                (side * 0.55, 0.3, 0.68),
                (side * 0.47, 0.4, 0.5),
                (side * 0.3, 0.4, 0.38),
                (side * 0.09, 0.2, 0.34),
            ]
        )
        roots = np.array([wrist, wrist, wrist, elbow, shoulder])
        for tip, root in zip(tips[:-1], roots, strict=False):
            sculpture.add_tube([as_point(root), as_point(tip)], [0.022, 0.012], blend=0.012)
        for number in range(len(tips) - 1):
            for part in np.linspace(0.0, 1.0, 13):
                root = (1 - part) * roots[number] + part * roots[number + 1]
                tip = (1 - part) * tips[number] + part * tips[number + 1]
                end = root + (1 - 0.22 * np.sin(np.pi * part)) * (tip - root)
                sculpture.add_tube([as_point(root), as_point(end)], [0.014, 0.012], blend=0.012)


def head(sculpture: SculptureGrid) -> None:
    """Skull, an open mouth, nostrils, eyes under brows, horns and a frill."""
    sculpture.add_ellipsoid((0, -0.37, 0.7), (0.075, 0.095, 0.065), blend=0.03)
    sculpture.add_tube([(0, -0.4, 0.7), (0, -0.53, 0.675)], [0.055, 0.036], blend=0.03)
    sculpture.add_tube([(0, -0.36, 0.655), (0, -0.5, 0.6)], [0.04, 0.02], blend=0.02)
    for side in SIDES:
        sculpture.add_ellipsoid((side * 0.024, -0.55, 0.7), (0.017, 0.02, 0.017), blend=0.012)
        sculpture.add_ellipsoid((side * 0.056, -0.42, 0.73), (0.02, 0.026, 0.02), blend=0.006)
        brow: list[Point] = [(side * 0.035, -0.46, 0.745), (side * 0.062, -0.41, 0.76), (side * 0.075, -0.35, 0.75)]
        sculpture.add_tube(brow, [0.012, 0.018, 0.012], blend=0.012)
        horn: list[Point] = [(side * 0.04, -0.33, 0.74), (side * 0.075, -0.25, 0.82), (side * 0.09, -0.14, 0.86)]
        sculpture.add_tube(horn, [0.026, 0.018, 0.007], blend=0.015)
        for level in (0.0, 1.0, 2.0):
            root: Point = (side * 0.06, -0.34, 0.71 - 0.03 * level)
            sculpture.add_tube([root, (side * 0.12, -0.27, 0.72 - 0.05 * level)], [0.018, 0.006], blend=0.012)


def as_point(place: np.ndarray) -> Point:
    """Three numbers as the sculpture takes them."""
    x, y, z = place.tolist()
    return x, y, z


def simplified(mesh: trimesh.Trimesh, faces: int) -> trimesh.Trimesh:
    """The mesh with about this many triangles, still closed (quadric decimation, Garland and Heckbert 1997)."""
    import pyvista
    import trimesh

    solid = pyvista.wrap(mesh).decimate(1 - faces / len(mesh.faces))
    return trimesh.Trimesh(solid.points, solid.faces.reshape(-1, 4)[:, 1:])
