"""One frame by the native step, wherever it can stand in for torch's."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.model.convolution import graph
from surfsup.model.correction import LARGEST, POSITION_SHARE, PRESSURE_SCALE
from surfsup.model.crowding import blown_up, collapsed, most_edges
from surfsup.model.features import (
    ACTIONS,
    DENSITY_SCALE,
    DISPLACEMENT_SCALE,
    SLOPE_SCALE,
    SURROUNDINGS,
    THICKEST,
    VELOCITY_SCALE,
    Features,
)
from surfsup.model.guard import CLEARANCE, Look
from surfsup.model.neighbours import neighbourhood
from surfsup.model.network import ConvolutionNetwork
from surfsup.model.solid_density import DEEPEST, NEAREST, OFFSET, STRENGTH, SUPPORT, TABLE_STEP, entries
from surfsup.model.solid_map import UNTURNED
from surfsup.model.state import FRAME_TIME, SOLVER_STEPS, State, Surroundings, free_fall_drop
from surfsup.model.sweeps import (
    DIMENSIONS,
    LEAST,
    MOST_DENSE,
    OF_EXCESS,
    OF_RISE,
    SLOW,
    SOFTENED,
    VISCOSITY,
    own_density,
)
from surfsup.model.walls import CLOSEST
from surfsup.scene import WALL_CELL

if TYPE_CHECKING:
    from surfsup.model.simulator import Simulator


@dataclass(frozen=True)
class LookAhead:
    """What the native code is given of a state.

    Attributes:
        places: (N, 3), metres.
        speeds: (N, 3), m/s.
        ahead: (N, 3) where ballistic motion would take it, metres.
        distance: (N,) of the solid from there, metres, or no more than that.
        told: the last two, the solid's normal there (N, 3), gravity, the corners of the container, the solid's map and
            how it is turned.
    """

    places: np.ndarray
    speeds: np.ndarray
    ahead: Tensor
    distance: Tensor
    told: list[np.ndarray | native.SolidMap | None]


class NativeStep:
    """The native twin of one simulator's network; made when first needed, and anew when the weights lie elsewhere.

    It reads the weights from where they are in every step: to tell whether they have changed is not safe (torch does
    not count what its fused optimisers write).

    Args:
        path: the instruction set to use; the best that the processor has, unless named.
    """

    def __init__(self, path: str | None = None) -> None:
        self.path = path or next(iter(native.paths()), "")
        self.of: ConvolutionNetwork | None = None
        self.weights: list[Tensor] = []  # of that network; to walk through its modules takes longer than the guard
        self.network: native.Network | None = None
        self.made_of: list[int] = []  # where the weights lay; the network keeps that memory from being given to others
        self.looked: tuple[Surroundings, Look] | None = None  # at which solid, and from where each particle did last

    def __reduce__(self) -> tuple[type[NativeStep], tuple[str]]:
        return NativeStep, (self.path,)  # a copy makes its own network

    def can_take(self, state: State, around: Surroundings, network: ConvolutionNetwork) -> bool:
        """Whether it may stand in: it is built, no gradient is wanted, all is single precision on the CPU."""
        if not self.path or torch.is_grad_enabled() or not network.layers:
            return False
        return all(
            value.dtype == torch.float32 and value.device.type == "cpu"
            for value in (*vars(state).values(), around.gravity, around.lower, network.encoder[0].weight)
        )

    def can_observe(self, state: State, around: Surroundings, network: ConvolutionNetwork) -> bool:
        """Whether it may see for the network: as :meth:`can_take`, but the network's own gradient may be wanted."""
        if not self.path or around.records_gradients():
            return False
        given = (*vars(state).values(), around.gravity, around.lower, network.encoder[0].weight)
        wanted = torch.is_grad_enabled() and any(value.requires_grad for value in given[:-1])
        return not wanted and all(value.dtype == torch.float32 and value.device.type == "cpu" for value in given)

    @torch.no_grad()
    def take(self, simulator: Simulator, state: State, around: Surroundings) -> tuple[Tensor, Tensor, Look]:
        """Positions (N, 3) and velocities (N, 3) one frame later, before the guard, and where it looked at the solid.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        ahead = ballistic(state, around)
        if around.felt is None:
            distance, normal = around.distance_and_normal(ahead)
            last = Look(ahead, distance.float())
        else:
            last, distance = self.look_again(ahead, around)
            normal = torch.zeros_like(ahead)
        seen = look_ahead(state, around, ahead, distance, normal)
        positions, velocities = np.empty_like(seen.speeds), np.empty_like(seen.speeds)
        self._run(simulator, self.network_of(simulator).step, seen, (positions, velocities))
        return torch.from_numpy(positions), torch.from_numpy(velocities), last

    def look_again(self, ahead: Tensor, around: Surroundings) -> tuple[Look, Tensor]:
        """From where each particle looked at the solid last, and how far that is off (N,) at least, metres.

        From ``ahead`` (N, 3) only those look that may be near it there: the rule feels the solid by its map; how far
        off it is exactly only the guard has to know, of what comes near. A learned distance may exaggerate, so a way
        counts twice.
        """
        before = self.looked
        if before is None or before[0] is not around or len(before[1].places) != len(ahead):
            places, distance = ahead.clone(), torch.zeros(len(ahead))  # so near that all of them look
        else:
            places, distance = before[1].places.clone(), before[1].distance.clone()
        at_least = torch.empty(len(ahead))
        written = (value.numpy() for value in (places, distance, at_least))
        native.look_again(ahead.numpy(), around.asked(), CLEARANCE, *written, torch.get_num_threads())
        self.looked = around, Look(places, distance)
        return self.looked[1], at_least

    @torch.no_grad()
    def observe(self, simulator: Simulator, state: State, around: Surroundings) -> tuple[LookAhead, Features]:
        """What the network is told, and what it is told from.

        Raises:
            SimulationError: as of :meth:`take`.
        """
        ahead = ballistic(state, around)
        seen = look_ahead(state, around, ahead, *around.distance_and_normal(ahead))
        count = len(seen.speeds)
        told = [np.empty((count, columns), np.float32) for columns in (ACTIONS, SURROUNDINGS, 3, 3, 3, 3)]
        self._run(simulator, self.network_of(simulator).observe, seen, told)
        acts, lie, faster, farther, slope, places = (torch.from_numpy(values) for values in told)
        radius = simulator.architecture.radius
        near = neighbourhood(0.5 * (state.positions + seen.ahead), radius)
        return seen, Features(acts, lie, faster, farther, slope, graph(places, near, radius))

    def _run(self, simulator: Simulator, call: Callable[..., int], seen: LookAhead, to: Iterable[np.ndarray]) -> None:
        radius = simulator.architecture.radius
        most = most_edges(len(seen.ahead), radius)
        edges = call(seen.places, seen.speeds, *seen.told, *to, self.path, torch.get_num_threads(), most)
        if edges < 0:
            raise blown_up()
        if edges > most:
            raise collapsed(radius)

    def network_of(self, simulator: Simulator) -> native.Network:
        """The native network of the weights where they are now."""
        if self.of is not simulator.network:
            self.of, self.weights = simulator.network, list(simulator.network.parameters())
        where = [weight.data_ptr() for weight in self.weights]
        if self.network is None or where != self.made_of:
            self.network, self.made_of = native_network(simulator), where
        return self.network


def ballistic(state: State, around: Surroundings) -> Tensor:
    """Where ballistic motion would lead (N, 3), metres."""
    places, speeds = state.positions.contiguous(), state.velocities.contiguous()
    ahead = torch.empty_like(places)
    drop = free_fall_drop(around.gravity)
    native.fall(places.numpy(), speeds.numpy(), FRAME_TIME, drop.numpy(), ahead.numpy())
    return ahead


def look_ahead(state: State, around: Surroundings, ahead: Tensor, distance: Tensor, normal: Tensor) -> LookAhead:
    """What the native code is given; the solid has that distance (N,) and normal (N, 3) from ``ahead`` (N, 3)."""
    places, speeds = state.positions.contiguous().numpy(), state.velocities.contiguous().numpy()
    distance, normal = distance.float(), normal.float().contiguous()
    told = [value.numpy() for value in (ahead, distance, normal, around.gravity, around.lower, around.upper)]
    felt = around.felt
    told += [None, UNTURNED] if felt is None else [felt.tables.native, felt.turn]
    return LookAhead(places, speeds, ahead, distance, told)


def native_network(simulator: Simulator) -> native.Network:
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
        solids=(share, DEEPEST, TABLE_STEP, SUPPORT, NEAREST, OFFSET, STRENGTH, WALL_CELL, CLOSEST),
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
