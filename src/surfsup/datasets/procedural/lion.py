"""A statue of a resting lion with a carved mane on a plinth.

It faces -y. The functions are named after the parts of the animal. P is the height of the plinth's upper side.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from surfsup.datasets.procedural.sculpting import Point, SculptureGrid, ellipsoid, tapered_capsule

if TYPE_CHECKING:
    import trimesh

CELL = 0.016  # meters
P = 0.26  # meters
SIDES = (-1.0, 1.0)
FACE = np.array([0.0, -0.52, P + 0.74])  # center of the mane's rings


def lion() -> trimesh.Trimesh:
    """The lion as closed triangles in meters, 1.9 long, standing on z = 0."""
    sculpture = SculptureGrid((-0.48, -0.96, 0.0), (0.48, 0.96, 1.45), CELL)
    plinth(sculpture)
    body(sculpture)
    legs(sculpture)
    tail(sculpture)
    mane(sculpture)
    head(sculpture)
    return sculpture.to_mesh()


def plinth(sculpture: SculptureGrid) -> None:
    """A base, a shaft with flutes, and a cornice."""
    sculpture.add_box((-0.46, -0.95, 0.0), (0.46, 0.95, 0.06), rounding=0.012)
    sculpture.add_box((-0.42, -0.91, 0.0), (0.42, 0.91, P - 0.02))
    sculpture.add_box((-0.46, -0.95, P - 0.06), (0.46, 0.95, P), rounding=0.015)

    def flutes(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        on_long_side = np.abs(x) > 0.40
        on_short_side = np.abs(y) > 0.89
        along = np.where(on_long_side, y, np.where(on_short_side, x, 0.0)) + 0 * z
        groove = np.maximum(np.cos(2 * np.pi * along / 0.07), 0) * (on_long_side | on_short_side)
        return 0.014 * groove

    sculpture.displace(flutes, np.array([-0.44, -0.93, 0.11]), np.array([0.44, 0.93, P - 0.11]))


def body(sculpture: SculptureGrid) -> None:
    """Trunk, shoulders, haunches."""
    sculpture.add_tube([(0, 0.6, P + 0.22), (0, 0.2, P + 0.29), (0, -0.2, P + 0.33)], [0.22, 0.215, 0.25], blend=0.08)
    sculpture.add_ellipsoid((0.0, -0.3, P + 0.34), (0.25, 0.24, 0.32), blend=0.08)
    for side in SIDES:
        sculpture.add_ellipsoid((side * 0.2, 0.56, P + 0.2), (0.14, 0.26, 0.23), blend=0.04)
        sculpture.add_ellipsoid((side * 0.21, -0.26, P + 0.3), (0.11, 0.17, 0.24), blend=0.05)


def legs(sculpture: SculptureGrid) -> None:
    """Forelegs stretched out to the front, hind legs folded under the haunches."""
    for side in SIDES:
        sculpture.add_tube(
            [(side * 0.25, -0.02, P + 0.1), (side * 0.24, -0.4, P + 0.09), (side * 0.22, -0.74, P + 0.075)],
            [0.1, 0.088, 0.07],
            blend=0.04,
        )
        sculpture.add_tube([(side * 0.31, 0.62, P + 0.07), (side * 0.31, 0.2, P + 0.065)], [0.08, 0.06], blend=0.04)
        paw(sculpture, (side * 0.22, -0.8, P + 0.07), size=1.0)
        paw(sculpture, (side * 0.31, 0.16, P + 0.055), size=0.75)


def paw(sculpture: SculptureGrid, at: Point, size: float) -> None:
    """A paw with four toes and the grooves between them."""
    x, y, z = at
    sculpture.add_ellipsoid(at, (0.1 * size, 0.11 * size, 0.07 * size), blend=0.03)
    for toe in (-1.5, -0.5, 0.5, 1.5):
        forward = 0.085 - 0.012 * abs(toe)
        sculpture.add_ellipsoid(
            (x + 0.047 * toe * size, y - forward * size, z - 0.018), (0.031 * size, 0.045 * size, 0.043 * size), 0.008
        )


def tail(sculpture: SculptureGrid) -> None:
    """A tail around the right haunch, with a tuft."""
    ends = [
        (0.02 + 0.38 * np.sin(1.9 * t), 0.84 - 0.52 * t**1.6, P + 0.1 - 0.06 * np.sin(np.pi * t / 2))
        for t in np.linspace(0.0, 1.0, 14)
    ]
    sculpture.add_tube(ends, [0.036] * len(ends), blend=0.02)
    x, y, z = ends[-1]
    sculpture.add_tube(
        [(x, y, z), (x - 0.01, y - 0.1, z + 0.02), (x - 0.02, y - 0.19, z)], [0.036, 0.055, 0.02], blend=0.02
    )


def mane(sculpture: SculptureGrid) -> None:
    """Rings of wavy locks around the face, larger towards the back, and rows of locks down the chest."""
    sculpture.add_ellipsoid((0.0, -0.33, P + 0.66), (0.33, 0.27, 0.4), blend=0.06)
    sculpture.add_ellipsoid((0.0, -0.42, P + 0.38), (0.25, 0.2, 0.3), blend=0.06)
    rings = (
        (0.31, 0.27, 22, -0.9),
        (0.29, 0.2, 24, 0.35),
        (0.3, 0.11, 26, 0.7),
        (0.28, 0.02, 24, 1.0),
        (0.235, -0.05, 22, 1.0),
    )
    for number, (radius, back, count, flare) in enumerate(rings):
        for angle in 2 * np.pi * (np.arange(count) + 0.5 * (number % 2)) / count:
            lock(sculpture, angle, radius, back, flare, wave=0.14 if number % 2 else -0.14)
    for row, (level, out, count) in enumerate(((0.5, 0.59, 7), (0.4, 0.605, 6), (0.3, 0.6, 5), (0.2, 0.575, 4))):
        for x in np.linspace(-0.033 * count, 0.033 * count, count):
            y = -out + 0.9 * x * x
            sway = 0.02 if row % 2 else -0.02
            sculpture.add_tube(
                [
                    (x, y + 0.05, P + level + 0.06),
                    (x + sway, y - 0.01, P + level),
                    (x - sway, y + 0.01, P + level - 0.09),
                ],
                [0.035, 0.034, 0.012],
                blend=0.012,
            )


def lock(sculpture: SculptureGrid, angle: float, radius: float, back: float, flare: float, wave: float) -> None:
    """One wavy lock from a ring around the face; ``flare`` scales how far it leans outward."""
    ends = []
    for step, (out, behind) in enumerate(((0.0, 0.0), (0.05, 0.02), (0.085, 0.065), (0.09, 0.125))):
        turned = angle + wave * np.sin(1.6 * step)
        reach = radius + flare * out
        higher = 1.02 if np.cos(turned) > 0 else 1.1  # the mane hangs down
        side, up = 0.86 * reach * np.sin(turned), reach * np.cos(turned) * higher - 0.25 * out
        ends.append((FACE[0] + side, FACE[1] + back + behind, FACE[2] + up))
    sculpture.add_tube(ends, [0.034, 0.04, 0.034, 0.014], blend=0.008)


def head(sculpture: SculptureGrid) -> None:
    """Skull, cheeks, muzzle, nose, eyes and brows, mouth, ears."""
    _, y, z = FACE
    sculpture.add_ellipsoid((0.0, y - 0.02, z + 0.03), (0.185, 0.2, 0.215), blend=0.03)
    sculpture.add_ellipsoid((0.0, y - 0.1, z + 0.11), (0.14, 0.12, 0.12), blend=0.04)  # forehead
    sculpture.add_tube(
        [(0, y - 0.14, z + 0.13), (0, y - 0.3, z + 0.0)], [0.06, 0.048], blend=0.04
    )  # bridge of the nose
    for side in SIDES:
        sculpture.add_ellipsoid((side * 0.115, y - 0.12, z - 0.03), (0.085, 0.1, 0.085), blend=0.04)  # cheek
        sculpture.add_ellipsoid((side * 0.048, y - 0.235, z - 0.075), (0.068, 0.1, 0.068), blend=0.045)  # upper lip
        socket = np.array([side * 0.098, y - 0.205, z + 0.048])
        sculpture.subtract(ellipsoid(socket, np.array([0.058, 0.05, 0.042])), socket - 0.06, socket + 0.06, blend=0.025)
        sculpture.add_ellipsoid((side * 0.092, y - 0.175, z + 0.046), (0.042, 0.036, 0.033))  # eye
        brow = [
            (side * 0.04, y - 0.235, z + 0.078),
            (side * 0.1, y - 0.215, z + 0.1),
            (side * 0.155, y - 0.15, z + 0.085),
        ]
        sculpture.add_tube(brow, [0.02, 0.024, 0.014], blend=0.025)
        ear = (side * 0.165, y + 0.02, z + 0.225)
        sculpture.add_ellipsoid(ear, (0.068, 0.04, 0.072), blend=0.02)
        hollow = np.array([side * 0.165, y - 0.028, z + 0.222])
        sculpture.subtract(ellipsoid(hollow, np.array([0.04, 0.03, 0.045])), hollow - 0.05, hollow + 0.05, blend=0.01)
    sculpture.add_ellipsoid((0.0, y - 0.305, z - 0.012), (0.066, 0.045, 0.04), blend=0.015)  # nose
    sculpture.add_ellipsoid((0.0, y - 0.22, z - 0.175), (0.078, 0.085, 0.06), blend=0.025)  # chin
    for number in range(7):  # a tuft under the chin
        angle = np.pi * (number - 3) / 8
        start = (0.07 * np.sin(angle), y - 0.17 - 0.05 * np.cos(angle), z - 0.2)
        sculpture.add_tube([start, (start[0] * 1.1, start[1] + 0.05, z - 0.28)], [0.03, 0.014], blend=0.01)
    for side in SIDES:
        groove(sculpture, [(0.0, y - 0.345, z - 0.05), (0.0, y - 0.34, z - 0.11)], 0.008)
        groove(
            sculpture,
            [(0.0, y - 0.34, z - 0.115), (side * 0.06, y - 0.32, z - 0.15), (side * 0.115, y - 0.22, z - 0.13)],
            0.011,
        )
        groove(sculpture, [(side * 0.022, y - 0.35, z - 0.02), (side * 0.05, y - 0.335, z - 0.005)], 0.008)  # nostril


def groove(sculpture: SculptureGrid, ends: list[Point], radius: float) -> None:
    """Cut a round groove through ``ends``."""
    for start, end in pairwise(np.array(ends)):
        low, high = np.minimum(start, end) - radius, np.maximum(start, end) + radius
        sculpture.subtract(tapered_capsule(start, end, radius, radius), low, high, blend=0.008)
