"""A simulation: a scene, a simulator, and the present state."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import FRAME_TIME, InitialParticles, Scene
from surfsup.scene.liquid import Liquid
from surfsup.scene.pose import NO_ROTATION, Pose, between, numbers
from surfsup.scene.solids import Solids
from surfsup.scene.strict_model import MAX_SPEED
from surfsup.scene.tap_checks import check_taps_and_drains
from surfsup.scene.taps import Tap
from surfsup.scene.wrench import Wrench
from surfsup.simulation_state import Frame, SimulationState, ids_of, liquids_of, open_fluid, with_liquids
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.crossings import CrossingCounter
from surfsup.sph.device import choose_device
from surfsup.sph.environment import Environment
from surfsup.sph.interpolation import ROUNDING, hermite
from surfsup.sph.liquid import LiquidForces
from surfsup.sph.mean_forces import MeanForces
from surfsup.sph.moving import FrameMotion, MovingSolids
from surfsup.sph.open_water import OpenState, Passages, WithTaps, common_particles
from surfsup.sph.rigid.bodies import RigidBodies
from surfsup.sph.rigid.body import BodyState
from surfsup.sph.scene_motion import SceneMotion, warn_jumps
from surfsup.sph.simulator import Simulator
from surfsup.sph.start import start_of
from surfsup.sph.thin_walls import ThinWallWarning, thin_wall_warning

COUPLINGS = 5  # of rigid bodies and water in a frame
MAX_SECONDS = 1e9
NO_FORCES: Mapping[str, Wrench] = {}


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

    Walls that are too thin for the particles are warned of (``ThinWallWarning``).

    Raises:
        InputError: simulator, device or a file of the scene cannot be used, no particle is left, or a rigid body has no
            volume or overlaps another solid.

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
        if not isinstance(scene, Scene):
            raise InputError(
                f"a simulation takes a Scene, not {type(scene).__name__}; Scene.load reads one from a scene file"
            )
        self.scene, self.handle_collisions = scene, handle_collisions
        self.name = simulator if isinstance(simulator, str) else type(simulator).__name__
        if isinstance(simulator, str):
            simulator, _ = load_simulator(simulator)
        self._device = choose_device("cpu" if device is None and scene.needs_native else device)
        if scene.forces and not simulator.measures_forces:
            raise InputError(f"{self.name} computes no forces on solids; use the simulator dfsph, or omit 'forces'")
        self._start_time = scene.start_time
        self._gravity: torch.Tensor | None = None  # of set_gravity
        self._liquid = scene.liquid
        self._taps = list(scene.taps)
        self.motion = SceneMotion(scene)
        if scene.is_open:
            check_taps_and_drains(scene, self.motion.solids)
            simulator = WithTaps(simulator, Passages.of(scene, self.motion.solids, self._start_time))
        self._simulator: Simulator[Any] = simulator.to(self._device)
        self.surface = self.motion.solids.still
        if warning := thin_wall_warning(self.motion.solids, scene.units):
            warnings.warn(warning, ThinWallWarning, stacklevel=2)
        solid = self.motion.solids.at_time(self._start_time)
        placed = scene.initial_particles(solid) if particles is None else particles
        self._units = scene.units.around(scene, placed)
        self._environment = self._make_environment(self.motion.solids)
        begun = start_of(scene, placed, self._environment, self._units) if particles is None else particles
        self.particles = begun
        start = self._units.particles_to_solver(begun)
        positions, velocities = (
            torch.from_numpy(values).to(self._device) for values in (start.positions, start.velocities)
        )
        fluid = with_liquids(self._simulator.initial_state(positions, velocities, self._environment), start)
        self._bodies = RigidBodies(scene, self.motion.solids)
        self._crossings = CrossingCounter(handle_collisions)
        poses = self.motion.solids.poses(self._start_time)
        self._start = SimulationState(0, fluid, poses, bodies=self._bodies.start())
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
        state = self._state
        fluid = state.fluid
        frame = self._as_frame(self.time, fluid.positions, fluid.velocities, state.poses, ids_of(fluid), state.forces)
        return replace(frame, liquids=liquids_of(fluid), bodies=state.bodies)

    def reset(self, state: SimulationState | None = None) -> None:
        """Return to an earlier state of this simulation, or of one of the same scene; by default to the start.

        Motions that :meth:`set_pose` and :meth:`set_motion` gave stay: they act from the next step on.

        Raises:
            InputError: it is no state of a simulation, or something moves in it that stands still in this one.
        """
        if state is not None and not isinstance(state, SimulationState):
            raise InputError(f"a simulation is reset to its 'state', not to {type(state).__name__}")
        state = self._start if state is None else state
        movable = self.motion.solids.poses(self._start_time)
        if unknown := [name for name in state.poses if name not in movable]:
            raise InputError(
                f"'{unknown[0]}' moves in the state, but stands still in this simulation; call set_pose for it first"
            )
        # What began to move after that state stood at rest in it.
        rest = {name: pose for name, pose in movable.items() if name not in state.poses}
        state = replace(state, poses={**rest, **state.poses}) if rest else state
        if isinstance(self._simulator, WithTaps):  # since set_taps
            state = replace(state, fluid=open_fluid(state))
        self._state = state

    def step(self) -> Frame:
        """Advance by a frame of the simulator and return the particles.

        That is 0.005 s with particles of 15 mm, and in proportion to the root of their radius with others.

        Raises:
            SimulationError: the simulation failed: particles are at infinity or collapsed into a clump.
        """
        self._step()
        return self.frame

    @torch.no_grad()
    def _step(self) -> None:
        """As :meth:`step`, without copies of the particles."""
        if not self._free(self._state):
            self._state = self._advance(self._state, 1.0, self._state.frame + 1)
            return
        state, forces = self._state, MeanForces()
        for part in range(1, COUPLINGS + 1):
            state = self._advance(state, 1 / COUPLINGS, self._state.frame + part / COUPLINGS)
            forces.add(part, state.forces)
        self._state = replace(state, frame=self._state.frame + 1, forces=forces.mean(0, COUPLINGS))

    def _free(self, state: SimulationState) -> dict[str, BodyState]:
        """The rigid bodies that move freely."""
        return {name: body for name, body in state.bodies.items() if name not in self.motion.driven}

    def _advance(self, state: SimulationState, part: float, end: float) -> SimulationState:
        """The state after a part of a frame, which ends at frame ``end``; its number stays for all but the whole."""
        environment, time = self._environment, part * self._units.frame_time
        poses = self.motion.next_poses(state.poses, self._start_time + end * self._units.frame_time)
        bodies = self._free(state)
        if bodies:
            bodies = self._bodies.advanced(bodies, self.motion.solids, state.poses, poses, time)
            poses = {**poses, **{name: body.pose for name, body in bodies.items()}}
        if environment.moving is not None:
            motion = self._motion_between(environment.moving, state.poses, poses, part)
            warn_jumps(motion, math.ceil(end), self._units)
            environment = environment.moved(motion)
        if self.scene.forces or bodies:
            environment = environment.measured()
        fluid, _ = self._simulator.step(state.fluid, environment, self.handle_collisions)
        impulses = environment.impulses
        forces = {} if impulses is None else impulses.wrenches(self._units, self.scene.density, part)
        number = state.frame + 1 if part == 1 else state.frame
        crossings = state.crossings + self._crossings.count(state.fluid, fluid, environment)
        return SimulationState(number, fluid, poses, forces, self._bodies.pushed(bodies, forces), crossings)

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
        changed = self.motion.overridden(name, motion)
        if changed.solids is self.motion.solids:
            self.motion = changed
            return
        # What stood still so far moves from now on, in a frame of its own.
        rest = changed.solids.poses(self._start_time)
        environment = self._make_environment(changed.solids)  # may fail, so that nothing is changed before
        self.motion, self.surface, self._environment = changed, changed.solids.still, environment
        self._state = replace(self._state, poses={name: rest[name], **self._state.poses})
        self._start = replace(self._start, poses=rest)

    def set_gravity(self, gravity: Sequence[float] | np.ndarray) -> None:
        """Let another gravity (3,) in m/s² act from the next step on; :meth:`reset` keeps it.

        Raises:
            InputError: it is not three finite numbers, or too large.
        """
        vector = numbers(gravity)
        if vector.shape != (3,) or not (np.abs(vector) <= MAX_SPEED).all():
            raise InputError(f"gravity is three numbers of m/s², at most {MAX_SPEED:g} (found {gravity})")
        self._gravity = torch.from_numpy(vector.astype(np.float32)).to(self._device)
        self._environment = replace(self._environment, gravity=self._gravity)

    def set_viscosity(self, viscosity: float | None) -> None:
        """Let the liquid have another kinematic viscosity from the next step on; :meth:`reset` keeps it.

        Args:
            viscosity: m²/s; None for what the solver needs for calm water.

        Raises:
            InputError: it is negative or not finite, the scene has several liquids, or the simulator knows none.
        """
        if self.scene.mixture:
            raise InputError("viscosity: the scene has several liquids, whose viscosities stay")
        liquid = Liquid(**{**dict(self._liquid or Liquid()), "viscosity": viscosity})
        forces = LiquidForces.of(self._units.liquid_to_solver(liquid))
        environment = replace(self._environment, liquid=forces)
        self._simulator.check_knows(environment)
        self._liquid, self._environment = liquid, environment

    def set_taps(self, taps: Sequence[Tap]) -> None:
        """Let these taps give water from the next step on, in the place of all others; :meth:`reset` keeps them.

        A tap opens and closes at its own times, in seconds of the scene. Water that a tap guides continues as it began
        if the tap stays, and flows freely from now on if it does not.

        Raises:
            InputError: a tap is in a solid or outside the container or has a liquid that the scene does not have, or
                the simulator knows no taps.
        """
        if other := [tap for tap in taps if tap.liquid and self.scene.liquid_of(tap) not in self.scene.mixture]:
            raise InputError(f"taps: a tap at {other[0].at} has a liquid that the scene does not have")
        scene = self.scene.with_taps(taps).with_mixture(self.scene.mixture)
        check_taps_and_drains(scene, self.motion.solids, self._state.poses)
        passages = Passages.of(scene, self.motion.solids, self._start_time, self._units)
        changed = WithTaps.around(self._simulator, passages)
        old = self._simulator.passages.taps.nozzles if isinstance(self._simulator, WithTaps) else ()
        new = passages.taps.nozzles
        stay = {id(nozzle): new[taps.index(tap)] for tap, nozzle in zip(self._taps, old, strict=True) if tap in taps}
        self._start = replace(self._start, fluid=open_fluid(self._start))
        self._state = replace(self._state, fluid=open_fluid(self._state).guided_by(stay))
        self._simulator, self._taps = changed, list(taps)

    def _make_environment(self, scene_solids: Solids) -> Environment:
        solids = self._units.solids_to_solver(scene_solids, self._start_time)
        solver_scene = self._units.scene_to_solver(self.scene)
        environment = Environment.of(solver_scene, solids.still, self._device, solids)
        if self._liquid is not self.scene.liquid:  # of set_viscosity
            environment = replace(environment, liquid=LiquidForces.of(self._units.liquid_to_solver(self._liquid)))
        if self._gravity is not None:
            environment = replace(environment, gravity=self._gravity)
        self._simulator.check_knows(environment)
        return environment

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
        return self._frames(self._state.frame, *self._steps(seconds, fps))

    def most_ids(self, seconds: float | None = None) -> int:
        """The number of ids up to the last frame of :meth:`run`: of particles that are or were in the scene by then.

        Raises:
            InputError: as :meth:`run`.
        """
        fluid = self._state.fluid
        if not isinstance(self._simulator, WithTaps) or not isinstance(fluid, OpenState):
            return len(fluid.positions)
        steps, interval = self._steps(seconds)
        return self._simulator.count(fluid, (math.ceil(steps / interval - ROUNDING) - 1) * interval)

    def _steps(self, seconds: float | None, fps: float | None = None) -> tuple[float, float]:
        """The steps in ``seconds``, and those from frame to frame; see :meth:`run`."""
        frame_time = self._units.frame_time
        rate = self.scene.fps if fps is None else fps
        for value in (seconds, rate):
            if value is not None and not (isinstance(value, int | float | np.number) and abs(value) <= MAX_SECONDS):
                raise InputError(f"seconds and fps are numbers up to {MAX_SECONDS:g} (found {value!r})")
        interval = 1.0 if rate is None else 1 / (rate * frame_time) if rate > 0 else math.inf
        steps = self.scene.frames * interval if seconds is None else seconds / frame_time
        if not (0 < steps < math.inf and 1 - ROUNDING <= interval < math.inf):
            raise InputError(f"seconds must be above 0 and fps above 0 and at most {1 / frame_time:.5g}")
        return steps, interval

    def record(self, path: str | Path, seconds: float | None = None) -> None:
        """Run for a while and write every frame to a trajectory file.

        Args:
            path: an HDF5 file; an existing file is replaced, but not the one that the scene continues.
            seconds: as in :meth:`run`.

        Raises:
            InputError: the file cannot be written, or the scene has a surface that no file describes.
            SimulationError: as :meth:`step`.
        """
        frames, count = self.run(seconds), self.most_ids(seconds)
        with TrajectoryWriter(Path(path), self.scene, Provenance(self.name), count, start_time=self.time) as writer:
            for frame in frames:
                writer.append(*frame.recorded)

    def _frames(self, first: int, steps: float, interval: float) -> Iterator[Frame]:
        before, means = self._state, MeanForces()
        for number in range(math.ceil(steps / interval - ROUNDING)):
            target = first + number * interval
            while self._state.frame < target - ROUNDING:
                before = self._state
                self._step()
                means.add(self._state.frame, self._state.forces)
            frame = self._between(before, target)
            yield (
                frame if number == 0 else replace(frame, forces=self._requested(means.mean(target - interval, target)))
            )
        while self._state.frame < first + steps - ROUNDING:
            self._step()

    def _between(self, before: SimulationState, target: float) -> Frame:
        """The particles at ``target`` frames, from the present state or between ``before`` and it."""
        part = target - (self._state.frame - 1)
        if part > 1 - ROUNDING:
            return self.frame
        old, new = before.fluid, self._state.fluid
        ids = ids_of(new)
        if isinstance(old, OpenState) and isinstance(new, OpenState):
            old, new, ids = common_particles(old, new, part)
        positions, velocities = hermite((old.positions, old.velocities), (new.positions, new.velocities), part)
        environment, poses = self._environment, before.poses
        if environment.moving is not None:
            start = {**self._state.poses, **before.poses}  # what began to move since then has not moved yet
            poses = {name: between(start[name], pose, part) for name, pose in self._state.poses.items()}
            environment = environment.moved(self._motion_between(environment.moving, start, poses, part))
        if self.handle_collisions:
            result = resolve_collisions(old.positions, positions, velocities, environment)
            positions, velocities = result.positions, result.velocities
        time = self._start_time + target * self._units.frame_time
        bodies = {
            name: BodyState.of(poses[name], (1 - part) * before.bodies[name].motion + part * body.motion)
            for name, body in self._state.bodies.items()
            if name in before.bodies and name in poses
        }
        frame = self._as_frame(time, positions, velocities, poses, ids)
        return replace(frame, liquids=liquids_of(new), bodies=bodies)

    def _motion_between(
        self, moving: MovingSolids, start: Mapping[str, Pose], end: Mapping[str, Pose], part: float = 1.0
    ) -> FrameMotion:
        """The motion between poses of the scene in a part of a frame, in the units of the solver."""
        before, after = ({name: self._units.pose_to_solver(pose) for name, pose in of.items()} for of in (start, end))
        return moving.between(before, after, part * FRAME_TIME)

    def _requested(self, forces: Mapping[str, Wrench]) -> Mapping[str, Wrench]:
        """The forces on the solids that the scene names."""
        names = self.scene.solid_names if self.scene.forces == "all" else self.scene.forces
        return {name: forces[name] for name in names if name in forces}

    def _as_frame(
        self,
        time: float,
        positions: torch.Tensor,
        velocities: torch.Tensor,
        poses: Mapping[str, Pose],
        ids: np.ndarray,
        forces: Mapping[str, Wrench] = NO_FORCES,
    ) -> Frame:
        """A frame with copies of the particles as NumPy arrays, in the units of the scene."""
        arrays = (values.detach().float().cpu().numpy().copy() for values in (positions, velocities))
        return Frame(time, *self._units.frame_from_solver(*arrays), poses, ids, self._requested(forces))
