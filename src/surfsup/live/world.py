"""The water of a live page, and what a person does to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree

from surfsup.errors import InputError
from surfsup.live.following import towards
from surfsup.live.recording import Recording
from surfsup.scene import Block, Scene
from surfsup.scene.pose import Pose
from surfsup.scene.shapes import Shape
from surfsup.scene.solids import NamedShape, as_named_shape
from surfsup.scene.taps import DiscOpening, Tap
from surfsup.simulation import Simulation
from surfsup.simulation_state import Frame, SimulationState
from surfsup.sph.open_water import OpenState
from surfsup.sph.simulator import FluidState
from surfsup.sph.state import ParticleState

SOLID = "solid"  # the name of a scene's single surface
MAX_PARTICLES = 50_000  # more cannot be real time on a few cores
SIMULATOR = "dfsph"  # the learned simulators are too slow


class LiveWorld:
    """A simulation that can be changed while it runs.

    Args:
        scene: of the start. Its surfaces without a motion of their own can be moved.
        folder: of the recordings.

    Attributes:
        scene: the scene, whose single surface has a name.
        movable: names of the surfaces that can be moved.
        tap: that is open, besides those of the scene; None if none is.

    Raises:
        InputError: a file of the scene is unusable, or no particle is left.
    """

    def __init__(self, scene: Scene, folder: Path) -> None:
        self._folder = folder
        self._recording: Recording | None = None
        self._start(with_named_surface(scene))

    def _start(self, scene: Scene) -> None:
        simulation = Simulation(scene, SIMULATOR, "cpu")
        check_count(len(simulation.particles.positions))
        self.scene, self.simulation, self._gravity = scene, simulation, scene.gravity
        self.tap: Tap | None = None
        self._units = scene.units.around(scene, simulation.particles)
        self.movable = [name for name, entry in scene.surfaces.items() if getattr(entry, "motion", None) is None]
        for name in self.movable:  # now, because the first movement builds a volume map
            self._place(name, resting_pose(scene, name))
        self._rest = dict(self.simulation.state.poses)
        self._targets = {name: self._rest[name] for name in self.movable}

    @property
    def frame(self) -> Frame:
        """The water now."""
        return self.simulation.frame

    @property
    def frame_time(self) -> float:
        """Seconds of a step."""
        return self.scene.units.frame_time

    def step(self) -> Frame:
        """Advance by a step; solids move towards where they shall be.

        Raises:
            SimulationError: the simulation failed.
        """
        poses, units = self.simulation.state.poses, self.scene.units
        for name, target in self._targets.items():
            if not is_at(poses[name], target):
                self._place(name, towards(poses[name], target, self.frame_time, units.velocity))
        frame = self.simulation.step()
        if self._recording is not None:
            self._recording.append(frame)
        return frame

    def pour(self, center: tuple[float, float, float], sides: tuple[float, float, float], liquid: int = 0) -> int:
        """Add a block of water at rest, except where solid, walls or water are; returns the number of particles.

        Args:
            center: (x, y, z), meters.
            sides: of the block, meters.
            liquid: its number, in a scene of several.

        Raises:
            InputError: the block is too thin for a particle, or there would be too many.
        """
        x, y, z = center
        a, b, c = (side / 2 for side in sides)
        block, spacing = Block((x - a, y - b, z - c), (x + a, y + b, z + c)), self.scene.spacing
        try:
            block.check_particle_count(spacing)
        except ValueError as error:
            raise InputError(f"pour: {error}") from None
        frame = self.frame
        added = self._free_sites(block.positions(spacing), frame)
        check_count(len(frame.positions) + len(added))
        if len(added) == 0:
            return 0
        state = self.simulation.state
        positions, velocities = self._units.frame_to_solver(added, np.zeros_like(added))
        fluid = with_particles(state.fluid, positions, velocities, liquid)
        self.simulation.reset(SimulationState(state.frame, fluid, state.poses))
        if self._recording is not None:
            self._recording.poured(self.frame)
        return len(added)

    def open_tap(self, center: tuple[float, float, float], radius: float, flow: float, liquid: int = 0) -> None:
        """Let water fall from a round opening from the next step on, in the place of what :meth:`open_tap` opened.

        Args:
            center: (x, y, z) of the opening, meters.
            radius: of the opening, meters.
            flow: liters a second.
            liquid: its number, in a scene of several.

        Raises:
            InputError: a value is out of range, or the water would begin in a solid or outside the container.
        """
        of = self.scene.mixture[liquid] if self.scene.mixture else None
        tap = Tap(disc=DiscOpening(radius=radius), at=center, flow=flow, liquid=of)
        tap = tap.model_copy(update={"start": self.simulation.time})
        self.simulation.set_taps([*self.scene.taps, tap])
        self.tap = tap

    def close_tap(self) -> None:
        """Let no more water come from the tap of :meth:`open_tap`."""
        if self.tap is not None:
            self.simulation.set_taps(self.scene.taps)
            self.tap = None

    @property
    def is_full(self) -> bool:
        """Whether there is more water than can be live; a tap should be closed then."""
        return len(self.simulation.state.fluid.positions) >= MAX_PARTICLES

    def _free_sites(self, positions: np.ndarray, frame: Frame) -> np.ndarray:
        """Those of ``positions`` (N, 3) that are clear of solids, walls and the water of ``frame``."""
        spacing, container = self.scene.spacing, self.scene.container
        free = np.ones(len(positions), bool)
        if not container.open:
            lower, upper = np.array(container.lower), np.array(container.upper)
            free &= ((positions > lower + spacing / 2) & (positions < upper - spacing / 2)).all(1)
        solid = self.simulation.motion.solids.at(frame.poses)
        if solid is not None:
            with torch.no_grad():
                free &= solid.distance(torch.from_numpy(positions)).numpy() > spacing
        distance, _ = cKDTree(frame.positions).query(positions)
        return positions[free & (distance > 0.9 * spacing)]

    def set_gravity(self, gravity: tuple[float, float, float]) -> None:
        """Let another gravity act from the next step on, m/s²."""
        self._gravity = gravity
        self.simulation.set_gravity(gravity)

    def set_viscosity(self, viscosity: float | None) -> None:
        """Let the liquid have another kinematic viscosity in m²/s, None for the solver's own, until the reset."""
        self.simulation.set_viscosity(viscosity)

    def move(self, name: str, pose: Pose) -> None:
        """Let a surface move to a pose, no faster than water can follow."""
        self._targets[name] = pose

    def set_particle_radius(self, radius: float) -> None:
        """Start anew with particles of another size, meters.

        Raises:
            InputError: the size is out of range, or a block of the scene is too thin for it.
        """
        scene = self.scene.with_changes(particle_radius=radius)
        check_count(round(len(self.simulation.particles.positions) * (self.scene.particle_radius / radius) ** 3))
        self.stop_recording()
        gravity = self._gravity
        self._start(scene)
        self.set_gravity(gravity)

    def reset(self) -> None:
        """Return to the start: its water, its poses, its gravity and its viscosity; the tap is closed."""
        self.stop_recording()
        self.close_tap()
        self._targets = {name: self._rest[name] for name in self.movable}
        for name, pose in self._targets.items():
            self._place(name, pose)
        self.simulation.reset()
        self.set_gravity(self.scene.gravity)
        if not self.scene.mixture:  # whose viscosities stay
            self.set_viscosity(None if self.scene.liquid is None else self.scene.liquid.viscosity)

    @property
    def recording(self) -> Path | None:
        """The file that is recorded to, if any."""
        return None if self._recording is None else self._recording.path

    def start_recording(self) -> Path:
        """Write every step from now on to a new trajectory file; returns its path.

        Raises:
            InputError: the file cannot be written.
        """
        self.stop_recording()
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{self._folder}: cannot be made ({error.strerror})") from None
        number = 1
        while list(self._folder.glob(f"recording-{number:03d}.*")):
            number += 1
        scene = self.scene.model_copy(update={"fps": None, "duration": None, "gravity": self._gravity})
        scene = scene.with_base_folder(self.scene.base_folder)
        self._recording = Recording(self._folder / f"recording-{number:03d}.h5", scene, SIMULATOR, self.frame)
        return self._recording.path

    def stop_recording(self) -> Path | None:
        """Finish the recording; returns its path, None without one.

        Raises:
            InputError: the disk is full.
        """
        if self._recording is None:
            return None
        recording, self._recording = self._recording, None
        return recording.finish()

    def _place(self, name: str, pose: Pose) -> None:
        self.simulation.set_pose(name, pose.position, pose.rotation)


def with_particles(fluid: FluidState, positions: np.ndarray, velocities: np.ndarray, liquid: int) -> FluidState:
    """The state with more particles (N, 3) of a liquid, in the units of the solver."""
    liquids = np.full(len(positions), liquid, np.int32)
    if isinstance(fluid, OpenState):
        return fluid.extended(positions, velocities, fluid.next_id + np.arange(len(positions)), [liquids])
    assert isinstance(fluid, ParticleState)  # the solver's
    new = {"positions": positions, "velocities": velocities, "liquids": liquids}
    return replace(
        fluid, **{name: torch.cat([value, torch.from_numpy(new[name])]) for name, value in vars(fluid).items()}
    )


def check_count(particles: int) -> None:
    """Refuse more particles than can be live.

    Raises:
        InputError: there are too many.
    """
    if particles > MAX_PARTICLES:
        raise InputError(f"{particles:,} particles are too many to be live, which goes up to {MAX_PARTICLES:,}")


def with_named_surface(scene: Scene) -> Scene:
    """The scene with its single surface under a name, because only named ones can be moved."""
    if scene.surface is None:
        return scene
    named = as_named_shape(scene.surface) if isinstance(scene.surface, Shape) else None
    surface = scene.surface if named is None else named
    return scene.model_copy(update={"surface": None, "surfaces": {SOLID: surface}}).with_base_folder(scene.base_folder)


def resting_pose(scene: Scene, name: str) -> Pose:
    """Where a surface stands in the scene."""
    entry = scene.surfaces[name]
    named = entry if isinstance(entry, NamedShape) else as_named_shape(entry)
    return Pose.of() if named is None else named.rest


def is_at(pose: Pose, target: Pose) -> bool:
    """Whether a pose is its target."""
    return np.array_equal(pose.array, target.array)
