"""Whether the taps and drains of a scene have room."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from surfsup.errors import InputError
from surfsup.scene.carriers import carrier_poses
from surfsup.scene.fill import distances
from surfsup.scene.nozzle import Nozzle
from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER, Solids

if TYPE_CHECKING:
    from surfsup.scene.scene import Scene

SAMPLES = 9  # along each side of the container


def check_taps_and_drains(scene: Scene, solids: Solids, present: Mapping[str, Pose] | None = None) -> None:
    """Require that taps are in the container and clear of solids, and that drains leave water in the scene.

    Args:
        scene: the scene.
        solids: its solids.
        present: poses by name of all that moves; by default those at the start of the scene.

    Raises:
        InputError: a tap is in a solid or outside the container, or a drain covers a tap or the whole container.
    """
    if not scene.is_open:
        return
    if present is None:
        present = solids.poses(scene.start_time)
    poses = {**carrier_poses(scene, solids, scene.start_time), **present}
    nozzles = [tap.nozzle(scene.spacing) for tap in scene.taps]
    layers = [guided_points(nozzle, poses) for nozzle in nozzles]
    surface = solids.at(present)
    for number, points in enumerate(layers):
        check_container(scene, number, points, poses)
        if surface is not None:
            close = int((distances(surface, points.astype(np.float32)) < scene.particle_radius).sum())
            if close:
                raise InputError(
                    f"taps.{number}: its water would begin in a solid, or closer to it than a particle radius "
                    f"({close} of {len(points)} particles of its first layers); move the tap or make it smaller"
                )
    for number, drain in enumerate(scene.drains):
        region = drain.surface(scene.base_folder)
        pose = Pose.of() if drain.carrier is None else poses[drain.carrier]
        for tap, points in enumerate(layers):
            own = pose.to_own(points[: len(nozzles[tap].points)])
            if (distances(region, own.astype(np.float32)) < 0).any():
                raise InputError(
                    f"drains.{number}: covers tap {tap}, whose water would leave at once; move one of them"
                )
        if not scene.container.open:
            samples = poses[CONTAINER].apply(container_samples(scene))
            if (distances(region, pose.to_own(samples).astype(np.float32)) < 0).all():
                raise InputError(
                    f"drains.{number}: covers the whole container, so that all water would leave; make it smaller"
                )


def guided_points(nozzle: Nozzle, poses: Mapping[str, Pose]) -> np.ndarray:
    """Where the particles of a layer are in the world as they pass the opening, and where they begin to flow freely."""
    points = np.concatenate([nozzle.points, nozzle.points + nozzle.guide * nozzle.velocity])
    return points if nozzle.carrier is None else poses[nozzle.carrier].apply(points)


def check_container(scene: Scene, number: int, points: np.ndarray, poses: Mapping[str, Pose]) -> None:
    """Require that the ``points`` (N, 3) of a tap are a particle radius inside the container."""
    own, radius = poses[CONTAINER].to_own(points), scene.particle_radius
    lower, upper = np.array(scene.container.lower), np.array(scene.container.upper)
    outside = (own < lower + radius) | (own > upper - radius)
    if outside.any():
        axis = int(np.argmax(outside.any(axis=0)))
        raise InputError(
            f"taps.{number}: its water would begin outside the container, or closer to a wall than a particle radius "
            f"(from {own[:, axis].min():.3g} to {own[:, axis].max():.3g} m along {'xyz'[axis]}, in a container from "
            f"{lower[axis]:.3g} to {upper[axis]:.3g} m); move the tap or make it smaller"
        )


def container_samples(scene: Scene) -> np.ndarray:
    """Points (N, 3) all over the container, in its own frame."""
    lower, upper = np.array(scene.container.lower), np.array(scene.container.upper)
    return lower + np.array(list(product(np.linspace(0.0, 1.0, SAMPLES), repeat=3))) * (upper - lower)
