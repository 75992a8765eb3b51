"""The page of a trajectory file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.io.scene_poses import scene_poses
from surfsup.io.trajectory import Trajectory
from surfsup.scene.carriers import carrier_poses
from surfsup.scene.scene_name import scene_name
from surfsup.scene.solids import CONTAINER, build_solids
from surfsup.viewing.liquid_look import looks_of
from surfsup.viewing.moving_mesh import MovingMesh
from surfsup.viewing.web_player import write_web_player

SOLID_RESOLUTION = 160  # cells of marching cubes
MOVING_RESOLUTION = 96  # the same for solids that move, whose shadows every picture needs anew

Progress = Callable[[int, int], None]  # numbers of finished and of all frames


def write_trajectory_page(file: Path, page: Path, progress: Progress) -> Path:
    """Write the page that plays the trajectory in ``file``, or in the folder of one; returns the path of the page."""
    with Trajectory(file) as trajectory:
        require_water(trajectory, file)
        still, moving = trajectory_meshes(trajectory)
        write_web_player(
            page,
            trajectory.positions[:],
            still,
            trajectory.scene.container.size,
            trajectory.radius,
            trajectory.frame_time,
            progress,
            moving,
            scene_poses(trajectory).get(CONTAINER),
            trajectory.scene.container.open,
            page_title(trajectory),
            trajectory.provenance.simulator,
            points_of_interest(trajectory),
            looks_of(trajectory.scene),
            trajectory.liquids,
        )
    return page


def page_title(trajectory: Trajectory) -> str:
    """The name of the scene; where it has none that of the folder, and first that of a file with one of its own."""
    path, scene = trajectory.path, scene_name(trajectory.scene)
    if path.name != "trajectory.h5":
        return f"{path.stem}: {scene}" if scene else path.stem
    return scene or path.resolve().parent.name


def trajectory_meshes(trajectory: Trajectory) -> tuple[trimesh.Trimesh | None, list[MovingMesh]]:
    """The triangles of what stands still in a trajectory, None without any, and the meshes that move."""
    solids = build_solids(trajectory.scene, list(trajectory.poses))
    still = None if solids.still is None else solids.still.to_mesh(SOLID_RESOLUTION)
    poses = scene_poses(trajectory)
    moving = [
        MovingMesh(solid.surface.to_mesh(MOVING_RESOLUTION), poses[solid.name], solid.name) for solid in solids.moving
    ]
    return still, moving


def points_of_interest(trajectory: Trajectory) -> np.ndarray:
    """The particles (N, 3) of frame 0 in meters; where there are taps, also their openings."""
    positions, scene = trajectory.positions[0][trajectory.ids(0)], trajectory.scene
    if not scene.taps:
        return positions
    poses = carrier_poses(scene, build_solids(scene), trajectory.start_time)
    openings = [
        np.array([tap.at]) if tap.carrier is None else poses[tap.carrier].apply(np.array([tap.at]))
        for tap in scene.taps
    ]
    # As many points as particles, so that the camera shows the openings too.
    return np.concatenate([positions, np.repeat(np.concatenate(openings), max(1, len(positions)), axis=0)])


def require_water(trajectory: Trajectory, file: Path) -> None:
    """Require a frame with a particle.

    Raises:
        InputError: there is none.
    """
    if 0 in trajectory.positions.shape:
        frames, particles, _ = trajectory.positions.shape
        raise InputError(f"{file}: has {frames} frames of {particles} particles, so there is nothing to show")
