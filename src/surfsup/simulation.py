"""A simulation: a scene, a simulator, and the present state."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.learned.loading import DEFAULT_SIMULATOR, load_simulator
from surfsup.scene import InitialParticles, Scene
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.device import choose_device
from surfsup.sph.environment import Environment
from surfsup.sph.interpolation import ROUNDING, hermite
from surfsup.sph.settle import start_of
from surfsup.sph.simulator import FluidState, Simulator


@dataclass(frozen=True)
class Frame:
    """The particles at one time.

    Attributes:
        time: seconds since the start of the scene.
        positions: (N, 3) float32, meters.
        velocities: (N, 3) float32, m/s.

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


@dataclass(frozen=True)
class SimulationState:
    """Where a simulation is; :meth:`Simulation.reset` returns to it.

    Attributes:
        frame: number of steps since the start of the scene.
        fluid: the simulator's own state, with tensors ``positions`` and ``velocities`` (N, 3), in the units of the
            simulator (:class:`surfsup.scene.Units`); with particles of 15 mm these are meters and m/s.

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
        surface: the scene's solid, or None.
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
        self._device = choose_device(device)
        self._simulator = simulator.to(self._device)
        self._units, self._start_time = scene.units, scene.start_time
        solver_scene = self._units.scene_to_solver(scene)
        solid = solver_scene.build_surface()
        self.surface = self._units.surface_from_solver(solid)
        self.particles = start_of(scene, self.surface) if particles is None else particles
        self._environment = Environment.of(solver_scene, solid, self._device)
        start = self._units.particles_to_solver(self.particles)
        positions, velocities = (
            torch.from_numpy(values).to(self._device) for values in (start.positions, start.velocities)
        )
        self._start = SimulationState(0, self._simulator.initial_state(positions, velocities, self._environment))
        self._state = self._start

    @property
    def state(self) -> SimulationState:
        """The present state. It never changes: a step makes a new one."""
        return self._state

    @property
    def time(self) -> float:
        """Seconds since the start of the scene, or of the one that it continues."""
        return self._start_time + self._state.frame * self._units.frame_time

    @property
    def frame(self) -> Frame:
        """The particles now."""
        return self._as_frame(self.time, self._state.fluid.positions, self._state.fluid.velocities)

    def reset(self, state: SimulationState | None = None) -> None:
        """Return to an earlier state of this simulation, or of one of the same scene; by default to the start.

        Raises:
            InputError: it is no state of a simulation.
        """
        if state is not None and not isinstance(state, SimulationState):
            raise InputError(f"a simulation is reset to its 'state', not to {type(state).__name__}")
        self._state = self._start if state is None else state

    @torch.no_grad()
    def step(self) -> Frame:
        """Advance by a frame of the simulator and return the particles.

        That is 0.005 s with particles of 15 mm, and in proportion to the root of their radius with others.

        Raises:
            SimulationError: the simulation failed: particles are at infinity or collapsed into a clump.
        """
        fluid, _ = self._simulator.step(self._state.fluid, self._environment, self.handle_collisions)
        self._state = SimulationState(self._state.frame + 1, fluid)
        return self.frame

    def run(self, seconds: float | None = None, fps: float | None = None) -> Iterator[Frame]:
        """Yield the present frame and those of the next ``seconds``; afterwards the state is the one at their end.

        Frames between two steps are interpolated by cubic Hermite splines through positions and velocities, and moved
        out of the solid where the spline enters it.

        Args:
            seconds: simulated time; by default that of the scene's frames.
            fps: frames per second, at most one frame a step (200 with particles of 15 mm); by default those of the
                scene, in which every step is a frame unless it says otherwise.

        Raises:
            InputError: a value is out of range.
            SimulationError: as :meth:`step`.
        """
        frame_time = self._units.frame_time
        rate = self.scene.fps if fps is None else fps
        interval = 1.0 if rate is None else 1 / (rate * frame_time) if rate > 0 else math.inf
        steps = self.scene.frames * interval if seconds is None else seconds / frame_time
        if not (0 < steps < math.inf and 1 - ROUNDING <= interval < math.inf):
            raise InputError(f"seconds must be above 0 and fps above 0 and at most {1 / frame_time:.5g}")
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
                writer.append(frame.positions, frame.velocities)

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
        positions, velocities = hermite((old.positions, old.velocities), (new.positions, new.velocities), part)
        if self.handle_collisions:
            result = resolve_collisions(old.positions, positions, velocities, self._environment)
            positions, velocities = result.positions, result.velocities
        return self._as_frame(self._start_time + target * self._units.frame_time, positions, velocities)

    def _as_frame(self, time: float, positions: torch.Tensor, velocities: torch.Tensor) -> Frame:
        """A frame with copies of the particles as NumPy arrays, in the units of the scene."""
        arrays = (values.detach().float().cpu().numpy().copy() for values in (positions, velocities))
        return Frame(time, *self._units.frame_from_solver(*arrays))
