"""A simulation: a scene, a simulator, and the present state."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.learned.loading import DEFAULT_SIMULATOR, load_simulator
from surfsup.scene import FRAME_TIME, InitialParticles, Scene
from surfsup.scene.pose import NO_ROTATION, Pose
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.device import choose_device
from surfsup.sph.environment import Environment
from surfsup.sph.scene_motion import SceneMotion, warn_jumps
from surfsup.sph.simulator import FluidState, Simulator

ROUNDING = 1e-6  # of a frame, by which times may differ


@dataclass(frozen=True)
class Frame:
    """The particles at one time.

    Attributes:
        time: seconds since the start of the scene.
        positions: (N, 3) float32, meters.
        velocities: (N, 3) float32, m/s.
        poses: of the solids that move, and of a container that moves, by name.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))])
        >>> frame = sf.Simulation(scene).step()
        >>> frame.time, frame.positions.shape, frame.velocities.shape
        (0.005, (125, 3), (125, 3))
    """

    time: float
    positions: np.ndarray
    velocities: np.ndarray
    poses: Mapping[str, Pose] = field(default_factory=dict)


@dataclass(frozen=True)
class SimulationState:
    """Where a simulation is; :meth:`Simulation.reset` returns to it.

    Attributes:
        frame: number of steps since the start of the scene.
        fluid: the simulator's own state, with tensors ``positions`` and ``velocities`` (N, 3).
        poses: of all that moves, by name.

    Examples:
        >>> import surfsup as sf
        >>> simulation = sf.Simulation(sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))]))
        >>> before = simulation.state
        >>> _ = simulation.step()
        >>> simulation.reset(before)
        >>> simulation.time
        0.0
    """

    frame: int
    fluid: FluidState
    poses: Mapping[str, Pose] = field(default_factory=dict)


class Simulation:
    """Water in a scene, frame by frame.

    Args:
        scene: surface, fluid, container and gravity.
        simulator: ``dfsph`` for the solver, the name of shipped weights such as ``surfsup``, the path of a weights
            file, or a simulator object.
        device: ``cpu`` or ``cuda``; by default a GPU if there is one.
        handle_collisions: whether collision handling keeps particles out of solid and walls.
        particles: of the first frame, instead of those of the scene's fluid.

    Attributes:
        scene: the scene.
        name: of the simulator.
        surface: the scene's solid, or None; without surfaces that move.
        motion: what moves; :meth:`set_pose` and :meth:`set_motion` control it.
        particles: of the first frame.

    Raises:
        InputError: simulator, device or a file of the scene cannot be used, or no particle is left.

    Examples:
        >>> import surfsup as sf
        >>> ball = sf.Transformed(sf.Sphere(0.2), translation=(0, 0, 0.2))
        >>> scene = sf.Scene(surface=ball, fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))])
        >>> simulation = sf.Simulation(scene, device="cpu")
        >>> frames = list(simulation.run(seconds=0.5, fps=60))
        >>> len(frames), frames[0].positions.shape
        (30, (125, 3))
        >>> round(simulation.time, 3)
        0.5
    """

    def __init__(
        self,
        scene: Scene,
        simulator: str | Simulator[Any] = DEFAULT_SIMULATOR,
        device: str | None = None,
        handle_collisions: bool = True,
        particles: InitialParticles | None = None,
    ) -> None:
        self.scene, self.handle_collisions = scene, handle_collisions
        self.name = simulator if isinstance(simulator, str) else type(simulator).__name__
        if isinstance(simulator, str):
            simulator, _ = load_simulator(simulator)
        self._device = choose_device("cpu" if device is None and scene.moves else device)
        self._simulator = simulator.to(self._device)
        self.motion = SceneMotion(scene)
        self.surface = self.motion.solids.still
        start = self.motion.solids.at_start()
        self.particles = scene.initial_particles(start) if particles is None else particles
        self._environment = self._make_environment()
        positions, velocities = (
            torch.from_numpy(values).to(self._device)
            for values in (self.particles.positions, self.particles.velocities)
        )
        fluid = self._simulator.initial_state(positions, velocities, self._environment)
        self._start = SimulationState(0, fluid, self.motion.solids.poses(0.0))
        self._state = self._start

    @property
    def state(self) -> SimulationState:
        """The present state. It never changes: a step makes a new one."""
        return self._state

    @property
    def time(self) -> float:
        """Seconds since the start of the scene."""
        return self._state.frame * FRAME_TIME

    @property
    def frame(self) -> Frame:
        """The particles now."""
        return as_frame(self.time, self._state.fluid.positions, self._state.fluid.velocities, self._state.poses)

    def reset(self, state: SimulationState | None = None) -> None:
        """Return to an earlier state of this simulation, or of one of the same scene; by default to the start.

        Raises:
            InputError: it is no state of a simulation.
        """
        if state is not None and not isinstance(state, SimulationState):
            raise InputError(f"a simulation is reset to its 'state', not to {type(state).__name__}")
        state = self._start if state is None else state
        # What began to move after that state stood at rest in it.
        rest = {name: pose for name, pose in self.motion.solids.poses(0.0).items() if name not in state.poses}
        self._state = replace(state, poses={**rest, **state.poses}) if rest else state

    @torch.no_grad()
    def step(self) -> Frame:
        """Advance by 0.005 s and return the particles.

        Raises:
            SimulationError: the simulation failed: particles are at infinity or collapsed into a clump.
        """
        number, environment = self._state.frame + 1, self._environment
        poses = self.motion.next_poses(self._state.poses, number * FRAME_TIME)
        if environment.moving is not None:
            environment = environment.moved(environment.moving.between(self._state.poses, poses))
            warn_jumps(environment, number)
        fluid, _ = self._simulator.step(self._state.fluid, environment, self.handle_collisions)
        self._state = SimulationState(number, fluid, poses)
        return self.frame

    def set_pose(
        self, name: str, position: Sequence[float] | np.ndarray, rotation: Sequence[float] | np.ndarray = NO_ROTATION
    ) -> None:
        """Move a named surface, or the ``container``, to a pose by the end of the next step, and keep it there.

        Args:
            name: its key under ``surfaces``.
            position: (3,) meters, of the origin of its own frame, where ``at`` puts it at rest.
            rotation: (4,) quaternion w, x, y, z of any length but zero.

        Raises:
            InputError: there is no such surface, a value is unusable, or the simulator knows no moving solids.
        """
        pose = Pose.of(position, rotation)
        self.set_motion(name, lambda time: pose)

    def set_motion(self, name: str, motion: Callable[[float], Pose]) -> None:
        """Move a named surface, or the ``container``, by a function from the time in seconds to its pose.

        Raises:
            InputError: there is no such surface, or the simulator knows no moving solids.
        """
        if self.motion.override(name, motion):
            return
        # What stood still so far moves from now on, in a frame of its own.
        poses = {name: self.motion.solids.poses(0.0)[name], **self._state.poses}
        self.surface = self.motion.solids.still
        self._environment = self._make_environment()
        self._state = replace(self._state, poses=poses)
        self._start = replace(self._start, poses=self.motion.solids.poses(0.0))

    def _make_environment(self) -> Environment:
        environment = Environment.of(self.scene, self.motion.solids.still, self._device, self.motion.solids)
        self._simulator.check_knows(environment)
        return environment

    def run(self, seconds: float | None = None, fps: float | None = None) -> Iterator[Frame]:
        """Yield the present frame and those of the next ``seconds``; afterwards the state is the one at their end.

        Frames between two steps are interpolated by cubic Hermite splines through positions and velocities, and moved
        out of the solid where the spline enters it.

        Args:
            seconds: simulated time; by default the scene's frames of 0.005 s.
            fps: frames per second, at most 200; by default every step is a frame.

        Raises:
            InputError: a value is out of range.
            SimulationError: as :meth:`step`.
        """
        steps = self.scene.frames if seconds is None else seconds / FRAME_TIME
        interval = 1.0 if fps is None else 1 / (fps * FRAME_TIME) if fps > 0 else math.inf
        if not (0 < steps < math.inf and 1 - ROUNDING <= interval < math.inf):
            raise InputError(f"seconds must be above 0 and fps above 0 and at most {1 / FRAME_TIME:g}")
        return self._frames(self._state.frame, steps, interval)

    def record(self, path: str | Path, seconds: float | None = None) -> None:
        """Run for a while and write every frame to a trajectory file.

        Args:
            path: an HDF5 file; an existing file is replaced.
            seconds: as in :meth:`run`.

        Raises:
            InputError: the file cannot be written, or the scene has a surface that no file describes.
            SimulationError: as :meth:`step`.
        """
        frames = self.run(seconds)
        count = len(self._state.fluid.positions)
        with TrajectoryWriter(Path(path), self.scene, Provenance(self.name), count) as writer:
            for frame in frames:
                writer.append(frame.positions, frame.velocities, frame.poses)

    def _frames(self, first: int, steps: float, interval: float) -> Iterator[Frame]:
        before = self._state
        for number in range(math.ceil(steps / interval - ROUNDING)):
            target = first + number * interval
            while self._state.frame < target - ROUNDING:
                before = self._state
                self.step()
            yield self._between(before, target)
        while self._state.frame < first + steps - ROUNDING:
            self.step()

    def _between(self, before: SimulationState, target: float) -> Frame:
        """The particles at ``target`` frames, from the present state or between ``before`` and it."""
        part = target - (self._state.frame - 1)
        if part > 1 - ROUNDING:
            return self.frame
        old, new = before.fluid, self._state.fluid
        positions, velocities = hermite(old, new, part)
        environment, poses = self._environment, before.poses
        if environment.moving is not None:
            motion = environment.moving.between(before.poses, self._state.poses).part(0, part)
            environment, poses = environment.moved(motion), motion.end
        if self.handle_collisions:
            result = resolve_collisions(old.positions, positions, velocities, environment)
            positions, velocities = result.positions, result.velocities
        return as_frame(target * FRAME_TIME, positions, velocities, poses)


def hermite(old: FluidState, new: FluidState, part: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Positions and velocities (N, 3) at a ``part`` of the way between two frames, on cubic Hermite splines."""
    s, h = part, FRAME_TIME
    positions = (
        (1 + 2 * s) * (1 - s) ** 2 * old.positions
        + s * (1 - s) ** 2 * h * old.velocities
        + s**2 * (3 - 2 * s) * new.positions
        + s**2 * (s - 1) * h * new.velocities
    )
    velocities = (
        6 * s * (1 - s) / h * (new.positions - old.positions)
        + (1 - s) * (1 - 3 * s) * old.velocities
        + s * (3 * s - 2) * new.velocities
    )
    return positions, velocities


def as_frame(time: float, positions: torch.Tensor, velocities: torch.Tensor, poses: Mapping[str, Pose]) -> Frame:
    """A frame with copies of the particles as NumPy arrays."""
    place, speed = (values.detach().float().cpu().numpy().copy() for values in (positions, velocities))
    return Frame(time, place, speed, poses)
