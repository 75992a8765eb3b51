"""What is wrong with the trajectory of a scene that was accepted, evaluated from the file alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from fault_campaign.inputs import LENGTH
from surfsup.io.trajectory import Trajectory
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER, build_solids
from surfsup.sph.energy import MAX_ENERGY_GAIN

INSIDE = 1e-3  # of a particle radius: how deep the file's rounded positions may be in the solid
FASTER, JET = (
    1.2,
    4.0,
)  # what pressure and contacts may make of the speed that the scene explains: of all water, of a splash
SPEED = 5.0  # m/s for particles of 15 mm: what a start that is too dense, or tension, explains


def unsound(folder: Path) -> str:
    """The first thing that is wrong, or nothing.

    The summary has no penetration, no particle out of the container, no crossing. Positions and velocities are finite.
    No particle is in a solid, by the signed distance in double precision at the poses of the file. Mass: the number of
    particles is that of the start and of the taps. Energy: where nothing drives the water, the mechanical energy grows
    by no more than the energy limiter allows; elsewhere no particle is faster than what drives it explains.
    """
    summary = json.loads((folder / "out" / "summary.json").read_text())
    for key in ("penetrations", "out_of_container", "crossings"):
        if summary[key]:
            return f"{summary[key]} {key.replace('_', ' ')}"
    with Trajectory(folder / "out" / "trajectory.h5") as trajectory:
        if len(trajectory) != trajectory.scene.frames:
            return f"{len(trajectory)} of {trajectory.scene.frames} frames"
        frames = list(read_frames(trajectory))
        for number, (positions, velocities) in enumerate(frames):
            if not (np.isfinite(positions).all() and np.isfinite(velocities).all()):
                return f"frame {number} has values that are not finite"
        checks = (inside_a_solid(trajectory, frames), mass(trajectory, frames, summary), energy(trajectory, frames))
    return "; ".join(filter(None, checks))


def read_frames(trajectory: Trajectory) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Positions and velocities (N, 3) of the particles that are in the scene, frame by frame."""
    for number in range(len(trajectory)):
        ids = trajectory.ids(number)
        yield tuple(data[number][ids].astype(float) for data in (trajectory.positions, trajectory.velocities))


def inside_a_solid(trajectory: Trajectory, frames: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """Particles in a solid or out of the container."""
    scene, slack = trajectory.scene, INSIDE * trajectory.radius
    solids = build_solids(scene)
    lower, upper = (np.array(corner) for corner in (scene.container.lower, scene.container.upper))
    for number, (positions, _) in enumerate(frames):
        poses = {name: Pose.from_array(row[number]) for name, row in trajectory.poses.items()}
        surface = solids.at(poses)
        if surface is not None and len(positions):
            with torch.no_grad():
                distance = surface.double().distance(torch.from_numpy(positions)).numpy()
            if count := int((distance < -slack).sum()):
                return f"frame {number}: {count} in a solid, {-distance.min() / trajectory.radius:.2g} radii deep"
        own = poses[CONTAINER].to_own(positions) if CONTAINER in poses else positions
        if count := int(((own < lower - slack) | (own > upper + slack)).any(axis=-1).sum()):
            return f"frame {number}: {count} out of the container"
    return ""


def mass(trajectory: Trajectory, frames: list[tuple[np.ndarray, np.ndarray]], summary: dict[str, int]) -> str:
    """Particles that are lost, or came from nowhere."""
    scene = trajectory.scene
    counts = [len(positions) for positions, _ in frames]
    if not scene.is_open:
        return "" if set(counts) == {counts[0]} else f"the number of particles varies: {counts}"
    expected = counts[0] + summary["entered"] - summary["left"]
    if counts[-1] != expected:
        return f"{counts[-1]} particles at the end, but {expected} entered and did not leave"
    seconds, particle = trajectory.frame_time * (len(frames) - 1), (2 * trajectory.radius) ** 3
    flow = sum(tap.area * tap.meters_per_second for tap in scene.taps) * seconds / particle
    layer = sum(tap.area for tap in scene.taps) / (2 * trajectory.radius) ** 2
    if not flow - 2 * layer - 1 <= summary["entered"] <= flow + 2 * layer + 1:
        return f"{summary['entered']} particles entered, where the taps give {flow:.0f}"
    return ""


def energy(trajectory: Trajectory, frames: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """Energy or speed from nowhere."""
    scene, gravity = trajectory.scene, np.array(trajectory.scene.gravity, dtype=float)
    scale = trajectory.radius / LENGTH
    seconds = trajectory.frame_time * (len(frames) - 1)
    free = not (scene.moves or scene.is_open or (scene.liquid and scene.liquid.surface_tension + scene.liquid.adhesion))
    energies = [
        float((0.5 * (velocities**2).sum(axis=-1) - positions @ gravity).mean()) if len(positions) else 0.0
        for positions, velocities in frames
    ]
    if free:
        steps = seconds / (0.005 * scale**0.5) + 1
        kinetic = float(0.5 * (frames[0][1] ** 2).sum(axis=-1).mean())
        # Each step of the simulator; then collision handling, which may lift a particle by its clearance.
        allowed = steps * MAX_ENERGY_GAIN * scale + np.linalg.norm(gravity) * 2 * trajectory.radius + 1e-3 * kinetic
        gain = max(energies) - energies[0]
        return f"gained {gain:.3g} J/kg, where {allowed:.3g} are allowed" if gain > allowed else ""
    start = float(np.linalg.norm(frames[0][1], axis=-1).max(initial=0.0))
    taps = max((tap.meters_per_second for tap in scene.taps), default=0.0)
    driven = fastest_solid(scene, trajectory)
    explained = start + float(np.linalg.norm(gravity)) * seconds + taps + driven + SPEED * scale**0.5
    for number, (_, velocities) in enumerate(frames):
        squares = (velocities**2).sum(axis=-1) if len(velocities) else np.zeros(1)
        for speed, factor in ((squares.mean() ** 0.5, FASTER), (squares.max() ** 0.5, JET)):
            if speed > factor * explained:
                return f"frame {number}: {speed:.3g} m/s, where {explained:.3g} are explained"
    return ""


def fastest_solid(scene: Scene, trajectory: Trajectory) -> float:
    """The largest speed of a point of what moves, m/s: of the corners of the box around it from frame to frame."""
    solids = build_solids(scene)
    fastest = 0.0
    for name, rows in trajectory.poses.items():
        if name == CONTAINER:
            corners = np.array([scene.container.lower, scene.container.upper])
        else:
            body = next(body for body in solids.moving if body.name == name)
            corners = np.array(body.surface.bounds())
        corners = np.stack(np.meshgrid(*corners.T), axis=-1).reshape(-1, 3)
        corners = np.clip(corners, -10, 10)
        places = np.array([Pose.from_array(row).apply(corners) for row in rows])
        if len(places) > 1:
            fastest = max(
                fastest, float(np.linalg.norm(np.diff(places, axis=0), axis=-1).max() / trajectory.frame_time)
            )
    return fastest
