"""Moves fluid apart that starts so close to walls that the solver's first step would throw it apart."""

from __future__ import annotations

import warnings

import numpy as np

from surfsup.scene import Block, InitialParticles, Scene
from surfsup.scene.solids import Solids
from surfsup.sdf import Surface
from surfsup.sph.decompress import decompressed
from surfsup.sph.environment import Environment

# Meters, with particles of 15 mm, from a wall to the nearest particle's center. Closer lattices are denser than the
# solver allows: at one wall it ejects them at 4 m/s, in an edge or a corner, as in a pool, they gain 0.2 and 0.85 J/kg
# (all measured).
WALL_DISTANCE = 0.034
CORNER_DISTANCE = 0.049


class CompressedStartWarning(UserWarning):
    """The fluid starts so close to walls that it was moved apart; the message says where and how far."""


def expansion_warning(scene: Scene, start: InitialParticles) -> str | None:
    """What to say of blocks so close to walls that the water expands at the start; None if they are not."""
    lattice = scene.restart is None and all(isinstance(entry.content, Block) for entry in scene.fluid)
    if not lattice or (found := gap_to_walls(scene, start)) is None:
        return None
    gap, distance, walls = found
    return (
        f"fluid: it begins {1000 * gap:.3g} mm from {walls}, where a lattice is denser than water at rest; it expands "
        f"in the first frames and gains energy, so a dam breaks too fast; leave {1000 * distance:.3g} mm to the first "
        "particle"
    )


def gap_to_walls(scene: Scene, start: InitialParticles) -> tuple[float, float, str] | None:
    """The gap to the walls, the one that is needed, both in meters, and the name of the walls; None if it suffices."""
    positions, size = start.positions, scene.units.length
    if not len(positions):
        return None
    gaps = np.concatenate(
        [positions.min(axis=0) - scene.container.lower, np.subtract(scene.container.upper, positions.max(axis=0))]
    )
    in_corner = (gaps < CORNER_DISTANCE * size).sum() > 1
    distance = (CORNER_DISTANCE if in_corner else WALL_DISTANCE) * size
    if scene.container.open or gaps.min() >= distance:
        return None
    return float(gaps.min()), distance, "several walls" if in_corner else "a wall"


def without_compression(scene: Scene, surface: Surface | None, start: InitialParticles) -> InitialParticles:
    """``start``, moved apart where its particles are too close to the container's walls.

    Args:
        scene: the scene.
        surface: its solids where they are at the start, both in the scene's own units.
        start: the particles, in the scene's own units.

    Warns:
        CompressedStartWarning: particles were moved.
    """
    if (found := gap_to_walls(scene, start)) is None:
        return start
    gap, distance, walls = found
    units = scene.units.around(scene, start)
    solid = units.surface_to_solver(surface)
    environment = Environment.of(units.scene_to_solver(scene), solid, solids=Solids(solid))
    apart = units.particles_from_solver(decompressed(units.particles_to_solver(start), environment))
    moved = np.linalg.norm(apart.positions - start.positions, axis=1)
    warnings.warn(
        f"fluid: it begins {1000 * gap:.3g} mm from {walls}, where the solver would "
        "find it too dense and throw it apart at once; so its particles are moved apart before, by "
        f"{1000 * moved.mean():.2g} mm on average, {1000 * moved.max():.2g} at most; leave {1000 * distance:.3g} mm to "
        "the first particle to keep its place",
        CompressedStartWarning,
        stacklevel=2,
    )
    return apart
