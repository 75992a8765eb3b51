"""The particles of a scene at its start."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.errors import InputError
from surfsup.memory import available_memory
from surfsup.scene import quaternion
from surfsup.scene.fill import Fill, distances
from surfsup.scene.fluid import Block, Fluid, InitialParticles
from surfsup.scene.particle_file import FileParticles, ParticleFile, read_particles
from surfsup.scene.pose import Pose
from surfsup.scene.strict_model import Vector
from surfsup.sdf import Surface

if TYPE_CHECKING:
    from surfsup.scene.container import Container
    from surfsup.scene.scene import Scene

# Minimum distance of particles of 15 mm at the start, meters: in the reference at most 0.04 % come closer (measured).
SURFACE_CLEARANCE = 0.0238
WALL_CLEARANCE = 0.024
UNIT_RATIO = 20  # a solid larger than as many containers is probably not in meters
OVERLAP = 0.9  # spacings: particles of two entries that are closer overlap
# Spacings between the particles of a file: of half of them, and of any two. Water at rest has pairs at 0.15 (measured).
MIN_MEDIAN_DISTANCE, MIN_DISTANCE = 0.5, 0.05
BYTES_PER_PARTICLE = 700  # 330 in the solver (measured), 250 in the trajectory writer, and some to spare


def initial_particles(scene: Scene, surface: Surface | None) -> InitialParticles:
    """The particles of ``scene``: see :meth:`surfsup.scene.Scene.initial_particles`."""
    if scene.restart is not None:
        return restarted(scene, surface)
    require_memory(scene)
    blocks: list[np.ndarray] = []
    velocities: list[Vector | np.ndarray] = []
    mixture = scene.mixture
    settle, liquids, placed, excluded = [], [], np.empty((0, 3), np.float32), 0
    for number, entry in enumerate(scene.fluid):
        positions, velocity = entry_particles(scene, number, entry, surface)
        free = np.ones(len(positions), dtype=bool)
        if surface is not None and not isinstance(entry.content, ParticleFile):
            free &= distances(surface, positions) >= SURFACE_CLEARANCE * scene.units.length
            if isinstance(entry.content, Fill) and entry.content.surface is None:  # water in a hollow ends at its walls
                positions, free = positions[free], free[free]
        if len(placed):
            from scipy.spatial import cKDTree

            free &= cKDTree(placed).query(positions)[0] > OVERLAP * scene.spacing
        excluded += int((~free).sum())
        if free.any():
            blocks.append(positions[free])
            velocities.append(velocity[free] if isinstance(velocity, np.ndarray) else velocity)
            settle.append(entry.settle)
            liquids += [mixture.index(scene.liquid_of(entry))] if mixture else []
            placed = np.concatenate([placed, positions[free]])
    if not blocks and scene.fluid:
        raise InputError(
            f"fluid: all {excluded} particles are inside the solid{size_hint(scene, surface)}; move the "
            f"{scene.fluid[0].kind} or make the surface smaller"
        )
    return InitialParticles(blocks, velocities, excluded, tuple(settle), tuple(liquids))


def size_hint(scene: Scene, surface: Surface | None) -> str:
    """What a message says of a solid so large that its file probably has other units than meters."""
    if surface is None:
        return ""
    lower, upper = surface.bounds().detach().cpu().double().numpy()
    if not is_in_other_units(lower, upper, scene.container):
        return ""
    size = " x ".join(f"{side:.4g}" for side in upper - lower)
    return f", which is {size} m; if its file is in millimeters, give it scale: 0.001"


def is_in_other_units(lower: np.ndarray, upper: np.ndarray, container: Container) -> bool:
    """Whether a solid with the corners ``lower`` and ``upper`` (3,) is too large for lengths in meters."""
    return bool((upper - lower).max() > UNIT_RATIO * max(container.size))


def entry_particles(
    scene: Scene, number: int, entry: Fluid, surface: Surface | None
) -> tuple[np.ndarray, Vector | np.ndarray]:
    """Positions (N, 3) of an entry of the fluid, before overlaps are left out, and their velocities."""
    content = entry.content
    if isinstance(content, Block):
        check_block(scene, number, content)
        return content.positions(scene.spacing), content.velocity
    if isinstance(content, ParticleFile):
        found = content.read(scene.base_folder)
        check_file(scene, str(scene.base_folder / content.file), found, surface)
        return found.positions, found.velocities
    shape = None if content.surface is None else content.surface.surface(scene.base_folder)
    positions = content.positions(shape, surface, scene.particle_radius)
    outside = outside_container(scene, positions, WALL_CLEARANCE * scene.units.length)
    if shape is not None and outside.any():
        lower, upper = positions.min(axis=0), positions.max(axis=0)
        if scene.container.motion is not None:
            raise InputError(f"fluid: the shape of fill {number} reaches {out_of_moved(container_at_start(scene))}")
        axis = int(np.argmax((lower < scene.container.lower) | (upper > scene.container.upper)))
        raise InputError(
            f"fluid: the shape of fill {number} reaches from {lower[axis]:.3g} to {upper[axis]:.3g} m along "
            f"{'xyz'[axis]}, outside the container ({scene.container.lower[axis]:.3g} to "
            f"{scene.container.upper[axis]:.3g} m) or to its wall; move it or enlarge the container"
        )
    return positions[~outside], content.velocity


def check_block(scene: Scene, number: int, block: Block) -> None:
    """Require that a block is inside the container.

    Raises:
        InputError: it is not.
    """
    clearance = WALL_CLEARANCE * scene.units.length
    if scene.container.motion is not None:
        corners = np.array(list(product(*block.particle_bounds(scene.spacing))))
        if outside_container(scene, corners, clearance).any():
            raise InputError(f"fluid: block {number} reaches {out_of_moved(container_at_start(scene))}")
        return
    limits = zip("xyz", scene.container.lower, scene.container.upper, strict=True)
    for (name, low, high), (first, last), start, end in zip(
        limits, block.particle_bounds(scene.spacing), block.min, block.max, strict=True
    ):
        if first < low + clearance or last > high - clearance:
            raise InputError(
                f"fluid: block {number} reaches from {start:.3g} to {end:.3g} m along "
                f"{name}, outside the container ({low:.3g} to {high:.3g} m); "
                "move the block or enlarge the container"
            )


def outside_container(scene: Scene, positions: np.ndarray, clearance: float) -> np.ndarray:
    """Which particles (N,) are closer than ``clearance`` meters to a wall, or outside."""
    lower, upper = np.array(scene.container.lower), np.array(scene.container.upper)
    if scene.container.motion is not None:
        positions = container_at_start(scene).to_own(positions)
    outside: np.ndarray = np.any((positions < lower + clearance) | (positions > upper - clearance), axis=1)
    return outside


def container_at_start(scene: Scene) -> Pose:
    """The pose of the container at the time at which the scene begins.

    Raises:
        InputError: the file of its poses is missing or unusable.
    """
    motion = scene.container.motion
    return Pose.of() if motion is None else motion.pose_function(Pose.of(), scene.base_folder)(scene.start_time)


def out_of_moved(pose: Pose) -> str:
    """The end of a message about water outside a container that moves."""
    x, y, z = pose.position
    turn = math.degrees(float(np.linalg.norm(quaternion.logarithm(pose.rotation))))
    return (
        f"outside the container, or to its wall, where its motion has it at the start: moved by ({x:.3g}, {y:.3g}, "
        f"{z:.3g}) m and rotated by {turn:.3g} degrees; move the water or the container"
    )


def check_file(scene: Scene, source: str, found: FileParticles, surface: Surface | None) -> None:
    """Require that the particles of a file can start a scene.

    Args:
        scene: the scene.
        source: name of the file.
        found: its particles.
        surface: the scene's solid.

    Raises:
        InputError: the radius differs, or particles are in the solid, outside the container or too close together.
    """
    radius = scene.particle_radius
    if found.radius is not None and not np.isclose(found.radius, radius, rtol=1e-6):
        raise InputError(
            f"{source}: has particles of radius {found.radius:g} m, but the scene of {radius:g} m; "
            f"set particle_radius to {found.radius:g}"
        )
    outside = outside_container(scene, found.positions, radius)
    problems = [("outside the container, or closer to a wall than their radius", outside)]
    if surface is not None:
        inside = distances(surface, found.positions) < radius
        problems.append(("inside the solid, or closer to it than their radius", inside))
    # In a splash two particles may meet; they are no error of a file where the file is a trajectory.
    if len(found.positions) > 1 and found.radius is None:
        from scipy.spatial import cKDTree

        nearest = np.asarray(cKDTree(found.positions).query(found.positions, k=2)[0])[:, 1]
        half = MIN_MEDIAN_DISTANCE * scene.spacing
        least = half if float(np.median(nearest)) < half else MIN_DISTANCE * scene.spacing
        problems.append(
            (f"closer than {least:.3g} m to another, where a spacing is {scene.spacing:.3g} m", nearest < least)
        )
    for problem, which in problems:
        if which.any():
            x, y, z = found.positions[which.argmax()]
            raise InputError(
                f"{source}: {which.sum()} of its {len(which)} particles are {problem}; the first is number "
                f"{int(which.argmax())} at ({x:.3g}, {y:.3g}, {z:.3g}) m"
            )


def restarted(scene: Scene, surface: Surface | None) -> InitialParticles:
    """The particles of the last frame of the trajectory that the scene continues."""
    assert scene.restart is not None
    path = scene.base_folder / scene.restart
    found = read_particles(path)
    check_file(scene, str(path), found, surface)
    liquids = (restarted_liquids(scene, path, found),) if scene.mixture else ()
    return InitialParticles([found.positions], [found.velocities], 0, (False,), liquids)


def restarted_liquids(scene: Scene, path: Path, found: FileParticles) -> np.ndarray:
    """The numbers (N,) of the liquids of the particles that ``scene`` continues.

    Raises:
        InputError: the trajectory has other liquids.
    """
    densities = tuple(liquid.density for liquid in scene.mixture)
    if found.liquids is None or found.densities != densities:
        has = (
            "one liquid"
            if found.liquids is None
            else f"liquids of {', '.join(f'{d:g}' for d in found.densities)} kg/m³"
        )
        raise InputError(
            f"{path}: has {has}, but the scene liquids of {', '.join(f'{density:g}' for density in densities)} kg/m³; "
            "continue it with the liquids that it has"
        )
    return found.liquids


def require_memory(scene: Scene) -> None:
    """Refuse blocks and taps of more particles than the memory of this machine holds.

    Raises:
        InputError: with their number, and the radius that would fit.
    """
    blocks = [entry.block for entry in scene.fluid if entry.block is not None]
    count = sum(math.prod(sites_along(block, axis, scene.spacing) for axis in range(3)) for block in blocks)
    entering = entering_particles(scene)
    available = available_memory() // BYTES_PER_PARTICLE
    if count + entering > available:
        fitting = scene.particle_radius * ((count + entering) / available) ** (1 / 3)
        from_taps = f", {entering:,} of them from taps" if entering else ""
        raise InputError(
            f"particle_radius: {scene.particle_radius:g} m gives {count + entering:,.0f} particles{from_taps}, but "
            f"this machine has memory for some {available:,}; with {round_up(fitting):g} m they would fit"
        )


def entering_particles(scene: Scene) -> int:
    """Number of particles that enter through taps until the last frame."""
    start = scene.start_time
    end = start + (scene.frames - 1) * scene.frame_time
    return sum(tap.nozzle(scene.spacing).count(start, end) for tap in scene.taps)


def sites_along(block: Block, axis: int, spacing: float) -> float:
    """Number of lattice sites of a block along an axis."""
    return max(0.0, (block.max[axis] - block.min[axis]) / spacing - 1)


def round_up(value: float) -> float:
    """A number with two digits that is at least ``value``."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step
