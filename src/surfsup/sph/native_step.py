"""One frame by the native step, wherever it can stand in for torch's."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.learned.corrected.correction import LARGEST, POSITION_SHARE, PRESSURE_SCALE
from surfsup.learned.corrected.features import (
    ACTIONS,
    DENSITY_SCALE,
    DISPLACEMENT_SCALE,
    SLOPE_SCALE,
    SURROUNDINGS,
    THICKEST,
    VELOCITY_SCALE,
    Features,
)
from surfsup.learned.corrected.network import ConvolutionNetwork
from surfsup.scene import WALL_CELL
from surfsup.sph.boundary.density import DEEPEST, NEAREST, OFFSET, STRENGTH, TABLE_STEP, entries
from surfsup.sph.boundary.map_interpolation import UNTURNED
from surfsup.sph.boundary.walls import CLOSEST
from surfsup.sph.collision import ALLOWED, Look
from surfsup.sph.dfsph import DIMENSIONS, LEAST, MOST_DENSE, OF_EXCESS, OF_RISE, SLOW, SOFTENED, VISCOSITY, own_density
from surfsup.sph.energy import GAIN
from surfsup.sph.kernel_sums import graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.stability import blown_up, collapsed, max_edges
from surfsup.sph.state import FRAME_TIME, SOLVER_STEPS, Environment, ParticleState

if TYPE_CHECKING:
    from surfsup.learned.corrected.simulator import CorrectedSimulator


class Taken(NamedTuple):
    """A frame that was taken.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        moved: (N,) bool, which particles the guard moved.
        last: from where each particle looked at the solid last.
        done: False where more energy was gained than may be: then it was not guarded either.
    """

    positions: Tensor
    velocities: Tensor
    moved: Tensor
    last: Look
    done: bool


class NativeStep:
    """The native twin of one simulator's network; made when first needed, and anew when the weights lie elsewhere.

    It reads the weights from where they are in every step: to tell whether they have changed is not safe (torch does
    not count what its fused optimizers write).

    Args:
        isa: the instruction set to use; the best that the processor has, unless named.
    """

    def __init__(self, isa: str | None = None) -> None:
        self.isa = isa or next(iter(native.instruction_sets()), "")
        self.of: ConvolutionNetwork | None = None
        self.weights: list[Tensor] = []  # of that network; to walk through its modules takes longer than the guard
        self.network: native.Network | None = None
        self.made_of: list[int] = []  # where the weights lay; the network keeps that memory from being given to others
        # At which solid particles looked, from where each did last and how far it was then.
        self.looked: tuple[Environment, tuple[np.ndarray, np.ndarray]] | None = None

    def __reduce__(self) -> tuple[type[NativeStep], tuple[str]]:
        return NativeStep, (self.isa,)  # a copy makes its own network

    def can_take(self, state: ParticleState, environment: Environment, network: ConvolutionNetwork) -> bool:
        """Whether it may stand in: it is built, no gradient is wanted, all is single precision on the CPU."""
        if not self.isa or torch.is_grad_enabled() or not network.layers:
            return False
        return all(
            value.dtype == torch.float32 and value.device.type == "cpu"
            for value in (*vars(state).values(), environment.gravity, environment.lower, network.encoder[0].weight)
        )

    def can_observe(self, state: ParticleState, environment: Environment, network: ConvolutionNetwork) -> bool:
        """Whether it may see for the network: as :meth:`can_take`, but the network's own gradient may be wanted."""
        if not self.isa or environment.records_gradients():
            return False
        given = (*vars(state).values(), environment.gravity, environment.lower, network.encoder[0].weight)
        wanted = torch.is_grad_enabled() and any(value.requires_grad for value in given[:-1])
        return not wanted and all(value.dtype == torch.float32 and value.device.type == "cpu" for value in given)

    @torch.no_grad()
    def take(
        self,
        simulator: CorrectedSimulator,
        state: ParticleState,
        environment: Environment,
        handle_collisions: bool = True,
    ) -> Taken:
        """One frame, all but cutting back a gain of energy.

        The rule feels the solid by its map; how far off it is exactly only the guard has to know, of what comes near.
        So only those particles look at it that may have come near since they last did. A learned distance may
        exaggerate, so a way counts twice.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        places, speeds = state.positions.contiguous().numpy(), state.velocities.contiguous().numpy()
        last = self.last_look(environment, len(places))
        reached = np.empty_like(places), np.empty_like(places), np.empty(len(places), bool)
        radius = simulator.architecture.radius
        most = max_edges(len(places), radius)
        edges, done = self.network_of(simulator).next_frame(
            places,
            speeds,
            environment.as_arrays,
            *felt_by(environment),
            environment.asked(),
            ALLOWED,
            handle_collisions,
            GAIN,
            last,
            reached,
            self.isa,
            torch.get_num_threads(),
            most,
        )
        refuse_collapse(edges, most, radius)
        self.looked = environment, last
        return Taken(*(torch.from_numpy(value) for value in reached), Look(*map(torch.from_numpy, last)), done)

    def last_look(self, environment: Environment, count: int) -> tuple[np.ndarray, np.ndarray]:
        """From where each of ``count`` particles looked at the solid last (N, 3), and how far it was then (N,), meters.

        Copies: others may be stepping from the same look.
        """
        before = self.looked
        if before is None or before[0] is not environment or len(before[1][1]) != count:
            return np.zeros((count, 3), np.float32), np.zeros(count, np.float32)  # so near that all of them look
        return before[1][0].copy(), before[1][1].copy()

    @torch.no_grad()
    def observe(
        self, simulator: CorrectedSimulator, state: ParticleState, environment: Environment
    ) -> tuple[Tensor, Tensor, Features]:
        """Where ballistic motion leads (N, 3), how far off the solid is there (N,), and what the network is told.

        Raises:
            SimulationError: as of :meth:`take`.
        """
        ahead, _ = state.ballistic(environment.gravity)
        distance, normal = (value.float().contiguous() for value in environment.distance_and_normal(ahead))
        radius, count = simulator.architecture.radius, len(ahead)
        told = [np.empty((count, columns), np.float32) for columns in (ACTIONS, SURROUNDINGS, 3, 3, 3, 3)]
        seen = (state.positions.contiguous(), state.velocities.contiguous(), ahead, distance, normal)
        most = max_edges(count, radius)
        edges = self.network_of(simulator).observe(
            *(value.numpy() for value in (*seen, environment.gravity, environment.lower, environment.upper)),
            *felt_by(environment),
            *told,
            self.isa,
            torch.get_num_threads(),
            most,
        )
        refuse_collapse(edges, most, radius)
        acts, lie, faster, farther, slope, places = (torch.from_numpy(values) for values in told)
        near = find_neighbors(0.5 * (state.positions + ahead), radius)
        return ahead, distance, Features(acts, lie, faster, farther, slope, graph(places, near, radius))

    def network_of(self, simulator: CorrectedSimulator) -> native.Network:
        """The native network of the weights where they are now."""
        if self.of is not simulator.network:
            self.of, self.weights = simulator.network, list(simulator.network.parameters())
        where = [weight.data_ptr() for weight in self.weights]
        if self.network is None or where != self.made_of:
            self.network, self.made_of = native_network(simulator), where
        return self.network


def felt_by(environment: Environment) -> tuple[native.SolidMap | None, np.ndarray]:
    """The solid's map, and how it is turned."""
    boundary_map = environment.boundary_map
    return (None, UNTURNED) if boundary_map is None else (boundary_map.tables.native, boundary_map.turn)


def refuse_collapse(edges: int, most: int, radius: float) -> None:
    """Raise what a number of edges tells of, see :meth:`native.Network.next_frame`.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed into a clump.
    """
    if edges < 0:
        raise blown_up()
    if edges > most:
        raise collapsed(radius)


def native_network(simulator: CorrectedSimulator) -> native.Network:
    """The native twin of a simulator's network, whose weights it shares."""
    network, radius = simulator.network, simulator.architecture.radius
    share = entries(torch.float32, torch.device("cpu")).numpy()

    def array(weight: Tensor) -> object:
        return weight.detach().numpy()

    first, last = network.factors[0], network.factors[2]
    return native.Network(
        encoder=array(network.encoder[0].weight),
        factors=(array(first.weight), array(first.bias), array(last.weight), array(last.bias)),
        layers=[(array(one.mix.weight), array(one.own.weight), array(one.out.weight)) for one in network.layers],
        decoder=(array(network.decoder[0].weight), array(network.decoder[2].weight)),
        solids=(share, DEEPEST, TABLE_STEP, KERNEL_SUPPORT, NEAREST, OFFSET, STRENGTH, WALL_CELL, CLOSEST),
        radius=radius,
        frame_time=FRAME_TIME,
        displacement_scale=DISPLACEMENT_SCALE,
        velocity_scale=VELOCITY_SCALE,
        slope_scale=SLOPE_SCALE,
        density_scale=DENSITY_SCALE,
        own_density=own_density(radius),
        steps=SOLVER_STEPS,
        of_rise=OF_RISE,
        of_excess=OF_EXCESS,
        slow=SLOW,
        least=LEAST,
        most_dense=MOST_DENSE,
        viscosity=DIMENSIONS * VISCOSITY,
        softened=SOFTENED,
        pressure_scale=PRESSURE_SCALE,
        position_share=POSITION_SHARE,
        largest=LARGEST,
        thickest=THICKEST,
    )
