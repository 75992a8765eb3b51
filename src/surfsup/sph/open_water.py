"""Water that enters and leaves during a simulation: a simulator with the taps and drains of a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, Scene, Units
from surfsup.scene.carriers import carrier_poses
from surfsup.scene.nozzle import Nozzle
from surfsup.scene.pose import Pose
from surfsup.scene.solids import Solids
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.drains import DrainRegion
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import MixtureState, ParticleState
from surfsup.sph.taps import CarrierMotion, Layer, Taps


@dataclass(frozen=True)
class OpenState:
    """The particles that are in the scene at the end of a frame.

    Attributes:
        fluid: their positions and velocities.
        ids: (N,) int64, ascending. A particle keeps its id, and no other gets it later.
        next_id: of the next particle that enters.
        frame: number of frames since the start; beside rigid bodies a frame is computed in parts.
        layers: those that taps still guide.
        drained: number of particles that drains have taken and no tap has given back.
    """

    fluid: ParticleState
    ids: np.ndarray
    next_id: int
    frame: float = 0
    layers: tuple[Layer, ...] = ()
    drained: int = 0

    @classmethod
    def of(cls, fluid: OpenState | ParticleState, frame: float) -> OpenState:
        """The state of particles at the end of a frame, whose ids are their indices unless they have some."""
        if isinstance(fluid, OpenState):
            return fluid
        count = len(fluid.positions)
        return cls(fluid, np.arange(count), count, frame)

    @property
    def positions(self) -> Tensor:
        """(N, 3), meters."""
        return self.fluid.positions

    @property
    def velocities(self) -> Tensor:
        """(N, 3), m/s."""
        return self.fluid.velocities

    @property
    def time(self) -> float:
        """Seconds since the start, in the units of the solver."""
        return self.frame * FRAME_TIME

    def guided_by(self, nozzles: Mapping[int, Nozzle]) -> OpenState:
        """The state with the layers of some nozzles, which others now guide.

        Args:
            nozzles: the new one by the ``id`` of the old one. Layers of all others are free.
        """
        layers = (replace(one, nozzle=nozzles[id(one.nozzle)]) for one in self.layers if id(one.nozzle) in nozzles)
        return replace(self, layers=tuple(layers))

    def only(self, kept: np.ndarray) -> OpenState:
        """The state without all particles but those ``kept`` (N,) bool."""
        if kept.all():
            return self
        rows = torch.from_numpy(np.flatnonzero(kept)).to(self.positions.device)
        return replace(self, fluid=self.fluid.rows(rows), ids=self.ids[kept])

    def extended(
        self, positions: np.ndarray, velocities: np.ndarray, ids: np.ndarray, liquids: Sequence[np.ndarray] = ()
    ) -> OpenState:
        """The state with more particles, whose ids are above all that were given before.

        Args:
            positions: (K, 3), meters.
            velocities: (K, 3), m/s.
            ids: (K,), ascending.
            liquids: numbers of their liquids, together (K,); only those of a mixture count.
        """
        new = {"positions": positions, "velocities": velocities}
        if isinstance(self.fluid, MixtureState):
            new["liquids"] = np.concatenate(liquids)
        fluid = replace(
            self.fluid,
            **{name: torch.cat([value, like(value, new[name])]) for name, value in vars(self.fluid).items()},
        )
        return replace(self, fluid=fluid, ids=np.concatenate([self.ids, ids]), next_id=int(ids[-1]) + 1)


@dataclass(frozen=True)
class Passages:
    """The taps and drains of a scene, in the units of the solver.

    Attributes:
        taps: of the scene.
        drains: of the scene.
        rest: poses by name of all surfaces, at which those are that do not move.
    """

    taps: Taps
    drains: tuple[DrainRegion, ...]
    rest: Mapping[str, Pose]

    @classmethod
    def of(cls, scene: Scene, solids: Solids, start_time: float, units: Units | None = None) -> Passages:
        """Those of a scene.

        Args:
            scene: in its own units.
            solids: its solids, in its own units.
            start_time: seconds of the scene at which the time of the solver is 0.
            units: of the simulation; by default those of the scene.

        Raises:
            InputError: a file of a drain is missing or unusable.
        """
        units = scene.units if units is None else units
        nozzles = [units.nozzle_to_solver(tap.nozzle(scene.spacing), start_time) for tap in scene.taps]
        drains = []
        for drain in scene.drains:
            surface = units.surface_to_solver(drain.surface(scene.base_folder))
            assert surface is not None
            start, until = (units.time_to_solver(time, start_time) for time in (drain.start, drain.end))
            drains.append(DrainRegion(surface, start, until, drain.carrier))
        poses = carrier_poses(scene, solids, start_time)
        rest = {name: units.pose_to_solver(pose) for name, pose in poses.items()}
        if mixture := scene.mixture:
            numbers = [mixture.index(scene.liquid_of(tap)) for tap in scene.taps]
            nozzles = [replace(nozzle, liquid=number) for nozzle, number in zip(nozzles, numbers, strict=True)]
        return cls(Taps(nozzles), tuple(drains), rest)

    def taken(self, before: np.ndarray, after: np.ndarray, end_time: float, motion: CarrierMotion) -> np.ndarray:
        """Which particles (N,) a drain takes in a frame, see :meth:`DrainRegion.takes`."""
        taken = np.zeros(len(after), bool)
        for drain in self.drains:
            taken |= drain.takes(before, after, end_time, motion)
        return taken


class WithTaps(Simulator[OpenState]):
    """A simulator whose water enters through taps and leaves through drains.

    Within a frame the number of particles is constant. At its end guided layers are put where their taps take them,
    drains take what has entered them, and the layers that have passed an opening since the last frame are added where
    they are by then, to a fraction of the frame.

    Args:
        simulator: advances the particles; its state is a :class:`ParticleState`.
        passages: the taps and drains.

    Raises:
        InputError: the simulator knows no taps and drains.
    """

    history_length: ClassVar[int] = 0

    def __init__(self, simulator: Simulator[ParticleState], passages: Passages) -> None:
        if not simulator.knows_taps:
            raise InputError(f"{type(simulator).__name__} does not know taps and drains; use the simulator dfsph")
        self.simulator, self.passages = simulator, passages

    @classmethod
    def around(cls, simulator: Simulator[Any], passages: Passages) -> WithTaps:
        """A simulator with these taps and drains instead of its own, if any.

        Raises:
            InputError: the simulator knows no taps and drains.
        """
        return cls(simulator.simulator if isinstance(simulator, WithTaps) else simulator, passages)

    def to(self, device: torch.device | str) -> WithTaps:
        """The simulator on a device; taps and drains are computed on the CPU."""
        return WithTaps(self.simulator.to(device), self.passages)

    def check_knows(self, environment: Environment) -> None:
        """Refuse an environment that the simulator does not know; see :class:`Simulator`."""
        self.simulator.check_knows(environment)

    def initial_state(self, positions: Tensor, velocities: Tensor, environment: Environment) -> OpenState:
        """The state of particles (N, 3) at the start of a scene, with ids from 0.

        In a scene that continues another, the layers that its taps guide are found among them.
        """
        fluid = self.simulator.initial_state(positions, velocities, environment)
        rest = self.passages.rest
        layers = self.passages.taps.find_layers(positions.cpu().numpy(), CarrierMotion(rest, rest, FRAME_TIME))
        return OpenState(fluid, np.arange(len(positions)), len(positions), layers=tuple(layers))

    def state_from_frames(self, positions: Tensor, velocities: Tensor) -> OpenState:
        """The state at one frame (1, N, 3), which then is the first."""
        fluid = self.simulator.state_from_frames(positions, velocities)
        return OpenState(fluid, np.arange(positions.shape[1]), positions.shape[1])

    def step(
        self, state: OpenState, environment: Environment, handle_collisions: bool = True
    ) -> tuple[OpenState, Tensor]:
        """The state one frame later, and which of its particles (N,) collision handling moved.

        Raises:
            SimulationError: as the simulator itself.
        """
        if state.layers:
            environment = environment.supplied(self.passages.taps.energy(state.layers) / max(1, len(state.ids)))
        fluid, collided = self.simulator.step(state.fluid, environment, handle_collisions)
        motion = self._carriers(environment)
        after = replace(state, fluid=fluid, frame=round(state.frame + motion.seconds / FRAME_TIME, 6))
        after = self._guided(after, motion, environment.gravity)
        kept = self._kept(state, after, motion)
        after = replace(after.only(kept), drained=after.drained + int((~kept).sum()))
        after = self._supplied(after, state.time, motion)
        added = len(after.ids) - int(kept.sum())
        if after.layers:
            after = self._cleared(state.only(kept), after, motion, environment, handle_collisions)
        moved = collided[torch.from_numpy(kept).to(collided.device)]
        return after, torch.cat([moved, moved.new_zeros(added)])

    def count(self, state: OpenState, frames: float) -> int:
        """Number of ids at most after a number of further frames."""
        return state.next_id + self.passages.taps.count(state.time, state.time + frames * FRAME_TIME)

    def _carriers(self, environment: Environment) -> CarrierMotion:
        motion, rest = environment.motion, self.passages.rest
        if motion is None:
            return CarrierMotion(rest, rest, FRAME_TIME)
        return CarrierMotion({**rest, **motion.start}, {**rest, **motion.end}, motion.seconds)

    def _guided(self, state: OpenState, motion: CarrierMotion, gravity: Tensor) -> OpenState:
        """The state with its guided layers where their taps take them; those that now flow freely are released.

        A layer that was guided for a part of the frame falls freely for the rest of it alone.
        """
        layers = tuple(layer for layer in state.layers if self.passages.taps.guides(layer, state.time))
        if state.layers:
            positions, velocities = state.positions.clone(), state.velocities.clone()
            for layer in state.layers:
                if not self.passages.taps.guides(layer, state.time):
                    free = min(motion.seconds, state.time - layer.time - layer.nozzle.guide)
                    index = torch.from_numpy(rows_of(layer.ids, state.ids)[0]).to(positions.device)
                    positions[index] -= 0.5 * (motion.seconds**2 - free**2) * gravity
                    velocities[index] -= (motion.seconds - free) * gravity
                    continue
                place, velocity = self.passages.taps.place(layer, state.time, motion)
                rows, there = rows_of(layer.ids, state.ids)
                index = torch.from_numpy(rows).to(positions.device)
                positions[index] = like(positions, place[there])
                velocities[index] = like(velocities, velocity[there])
            state = replace(state, fluid=replace(state.fluid, positions=positions, velocities=velocities))
        return replace(state, layers=layers)

    def _cleared(
        self,
        before: OpenState,
        after: OpenState,
        motion: CarrierMotion,
        environment: Environment,
        handle_collisions: bool,
    ) -> OpenState:
        """The state without free water where taps guide theirs."""
        free = np.ones(len(after.ids), bool)
        for layer in after.layers:
            free[rows_of(layer.ids, after.ids)[0]] = False
        rows = np.flatnonzero(free)
        place, velocity = (
            values.detach().double().cpu().numpy()[rows] for values in (after.positions, after.velocities)
        )
        place, velocity, moved = self.passages.taps.cleared(after.layers, after.time, motion, place, velocity)
        if not moved.any():
            return after
        index = torch.from_numpy(rows[moved]).to(after.positions.device)
        positions, velocities = after.positions.clone(), after.velocities.clone()
        new = like(positions, place[moved]), like(velocities, velocity[moved])
        if handle_collisions:
            result = resolve_collisions(before.positions[index], *new, environment)
            new = result.positions, result.velocities
        positions[index], velocities[index] = new
        return replace(after, fluid=replace(after.fluid, positions=positions, velocities=velocities))

    def _kept(self, before: OpenState, after: OpenState, motion: CarrierMotion) -> np.ndarray:
        """Which particles (N,) no drain takes in a frame that begins with ``before``."""
        if not self.passages.drains or not len(after.ids):
            return np.ones(len(after.ids), bool)
        start, end = (positions.detach().double().cpu().numpy() for positions in (before.positions, after.positions))
        return ~self.passages.taken(start, end, after.time, motion)

    def _supplied(self, state: OpenState, start_time: float, motion: CarrierMotion) -> OpenState:
        """The state with the layers that have passed an opening since ``start_time``."""
        layers, drained = self.passages.taps.new_layers(start_time, state.time, state.next_id, state.drained)
        if not layers:
            return state
        parts = [self.passages.taps.place(layer, state.time, motion) for layer in layers]
        positions, velocities = (np.concatenate(values) for values in zip(*parts, strict=True))
        liquids = [np.full(len(layer.ids), layer.nozzle.liquid, np.int32) for layer in layers]
        extended = state.extended(positions, velocities, np.concatenate([layer.ids for layer in layers]), liquids)
        return replace(extended, layers=(*state.layers, *layers), drained=drained)


def common_particles(
    before: OpenState, after: OpenState, part: float
) -> tuple[ParticleState, ParticleState, np.ndarray]:
    """Two consecutive states with the particles that are in the scene at a ``part`` of the way, and their ids.

    These are the particles in both, and those that have passed an opening by then. The earlier state has the latter
    where they come from, on a straight way.
    """
    ids, old_rows, new_rows = np.intersect1d(before.ids, after.ids, assume_unique=True, return_indices=True)
    time = before.time + part * FRAME_TIME
    fresh = [layer.ids for layer in after.layers if before.time < layer.time <= time]
    entered = np.concatenate([np.empty(0, np.int64), *fresh])
    device = after.positions.device
    rows = torch.from_numpy(np.concatenate([new_rows, rows_of(entered, after.ids)[0]])).to(device)
    new = after.fluid.rows(rows)
    here = torch.from_numpy(old_rows).to(device)
    come = new.positions[len(ids) :] - FRAME_TIME * new.velocities[len(ids) :]
    old = ParticleState(
        torch.cat([before.positions[here], come]), torch.cat([before.velocities[here], new.velocities[len(ids) :]])
    )
    return old, new, np.concatenate([ids, entered])


def rows_of(some: np.ndarray, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows of ``some`` (n,) ids in the ascending ``ids`` (N,), and which of them (n,) are there."""
    rows = np.searchsorted(ids, some)
    there = rows < len(ids)
    there[there] = ids[rows[there]] == some[there]
    return rows[there], there


def like(tensor: Tensor, values: np.ndarray) -> Tensor:
    """``values`` in the precision and on the device of ``tensor``."""
    return torch.from_numpy(np.ascontiguousarray(values)).to(tensor)
