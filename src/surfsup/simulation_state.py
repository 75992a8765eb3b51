"""A frame as users see it, and the state between two frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from surfsup.io.output_folder import OutputFrame
from surfsup.scene import InitialParticles
from surfsup.scene.pose import Pose
from surfsup.scene.wrench import Wrench
from surfsup.sph.open_water import OpenState
from surfsup.sph.rigid.body import BodyState
from surfsup.sph.simulator import FluidState
from surfsup.sph.state import MixtureState, ParticleState, mixture_state


@dataclass(frozen=True)
class Frame:
    """The particles at one time.

    Attributes:
        time: seconds since the start of the scene.
        positions: (N, 3) float32, meters.
        velocities: (N, 3) float32, m/s.
        poses: of the solids that move, and of a container that moves, by name.
        ids: (N,) int64, ascending; a particle keeps its id. 0 to N - 1 where water neither enters nor leaves.
        forces: force and torque of the fluid on the solids that the scene names under ``forces``, mean over the time
            since the frame before. The first frame has none.
        liquids: (N,) int32, in a scene of several liquids which of :attr:`surfsup.Scene.mixture` each particle is; None
            in others.
        bodies: velocities and accelerations of the rigid bodies, by name.

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
    ids: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    forces: Mapping[str, Wrench] = field(default_factory=dict)
    liquids: np.ndarray | None = None
    bodies: Mapping[str, BodyState] = field(default_factory=dict)

    def __repr__(self) -> str:
        """The time and the number of particles, not all their numbers."""
        return f"<Frame at {self.time:g} s, {len(self.positions)} particles>"

    @property
    def recorded(self) -> OutputFrame:
        """What a trajectory file has of it."""
        motions = {name: body.motion for name, body in self.bodies.items()}
        return OutputFrame(self.positions, self.velocities, self.poses, self.ids, self.forces, self.liquids, motions)


@dataclass(frozen=True)
class SimulationState:
    """Where a simulation is; :meth:`Simulation.reset` returns to it.

    Attributes:
        frame: number of steps since the start of the scene.
        fluid: the simulator's own state, with tensors ``positions`` and ``velocities`` (N, 3), in the units of the
            simulator (:class:`surfsup.scene.Units`); with particles of 15 mm these are meters and m/s.
        poses: of all that moves, by name, in the units of the scene.
        forces: on the solids in the last step, mean, by name, in the units of the scene.
        bodies: velocities and accelerations of the rigid bodies by name, in the units of the scene.
        crossings: number of times so far that the straight way of a particle in a step led through a solid.

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
    forces: Mapping[str, Wrench] = field(default_factory=dict)
    bodies: Mapping[str, BodyState] = field(default_factory=dict)
    crossings: int = 0

    def __repr__(self) -> str:
        """The frame and the number of particles, not all their numbers."""
        return f"<SimulationState after {self.frame} steps, {len(self.fluid.positions)} particles>"


def with_liquids(fluid: FluidState, start: InitialParticles) -> FluidState:
    """A state of the particles of ``start`` that knows which liquid each is, in a scene of several."""
    if start.liquids is None:
        return fluid
    if isinstance(fluid, OpenState):
        return replace(fluid, fluid=mixture_state(fluid.fluid, start.liquids))
    assert isinstance(fluid, ParticleState)
    return mixture_state(fluid, start.liquids)


def liquids_of(fluid: FluidState) -> np.ndarray | None:
    """The numbers (N,) of the liquids of the particles of a state; None in a scene of one liquid."""
    particles = fluid.fluid if isinstance(fluid, OpenState) else fluid
    return particles.liquids.numpy() if isinstance(particles, MixtureState) else None


def open_fluid(state: SimulationState) -> OpenState:
    """The particles of a state as those of a simulation in which water enters or leaves."""
    assert isinstance(state.fluid, OpenState | ParticleState)  # the solver's
    return OpenState.of(state.fluid, state.frame)


def ids_of(fluid: FluidState) -> np.ndarray:
    """The ids (N,) of the particles of a state."""
    return fluid.ids if isinstance(fluid, OpenState) else np.arange(len(fluid.positions))
