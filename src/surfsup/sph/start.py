"""How a scene begins: no denser than at rest, and at rest where it says so."""

from __future__ import annotations

import warnings

import numpy as np

from surfsup.scene import InitialParticles, Scene
from surfsup.scene.particle_file import ParticleFile
from surfsup.scene.units import Units
from surfsup.sph.decompress import decompressed
from surfsup.sph.environment import Environment
from surfsup.sph.settle import settled

MOVED = 0.1  # radii: water that is moved further on average before it begins is reported
# Radii from both walls of a corner to the first particle. Nearer, a lattice is denser than at rest (measured).
CORNER_DISTANCE = 3.3


class OmittedParticlesWarning(UserWarning):
    """Particles have no place at the start; the message says how many."""


class MovedApartWarning(UserWarning):
    """The water begins denser than at rest and was moved apart; the message says how far."""


def at_rest(environment: Environment) -> Environment:
    """The environment while all that moves rests where it is at time 0."""
    if environment.moving is None:
        return environment
    poses = environment.moving.solids.poses(0.0)
    return environment.moved(environment.moving.between(poses, poses))


def start_of(scene: Scene, particles: InitialParticles, environment: Environment, units: Units) -> InitialParticles:
    """The particles of a scene, nowhere denser than at rest, and at rest where it says so.

    Particles of files and of trajectories keep their places, unless they settle.

    Args:
        scene: the scene.
        particles: as the scene places them (:meth:`surfsup.scene.Scene.initial_particles`), in its own units.
        environment: in the units of the solver; nothing moves before the scene begins.
        units: of the solver.

    Warns:
        OmittedParticlesWarning: particles of the scene overlap the solid or each other.
        MovedApartWarning: the start is denser than at rest, so that the water was moved apart.
        NoRoomWarning: it is denser than at rest even so.
        NotSettledWarning: water was still moving after the time limit.
    """
    environment = at_rest(environment)
    from_files = scene.restart is not None or any(isinstance(entry.content, ParticleFile) for entry in scene.fluid)
    placed = units.particles_to_solver(particles)
    water = placed if from_files or not len(placed.positions) else decompressed(placed, environment)
    if any(water.settle):
        water = settled(water, environment, units.velocity)
    elif water is not placed:
        warn_moved(units.length * np.linalg.norm(water.positions - placed.positions, axis=1), scene.particle_radius)
    if water.excluded:
        warnings.warn(
            f"fluid: {water.excluded} particles that overlap the solid or each other at the start were omitted",
            OmittedParticlesWarning,
            stacklevel=3,
        )
    return particles if water is placed else units.particles_from_solver(water)


def warn_moved(distances: np.ndarray, radius: float) -> None:
    """Say how far the particles of a start were moved, (N,) in meters, if that can be seen."""
    if distances.mean() > MOVED * radius:
        warnings.warn(
            "fluid: it begins so close to walls or solids that a lattice there is denser than water at rest; so its "
            f"particles are moved apart first, by {1000 * distances.mean():.3g} mm on average, "
            f"{1000 * distances.max():.3g} mm at most; leave {1000 * CORNER_DISTANCE * radius:.3g} mm to the first "
            "particle to keep its place",
            MovedApartWarning,
            stacklevel=4,
        )
