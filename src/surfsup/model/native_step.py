"""One frame by the native step, wherever it can stand in for torch's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.model.correction import LARGEST, POSITION_SHARE
from surfsup.model.features import (
    DENSEST,
    DENSITY_SCALE,
    DISPLACEMENT_SCALE,
    NEARNESS_SCALE,
    REACH,
    THICKEST,
    VELOCITY_SCALE,
    own_density,
)
from surfsup.model.guard import Look
from surfsup.model.neighbours import blown_up, collapsed, most_edges
from surfsup.model.network import ConvolutionNetwork
from surfsup.model.solid_density import DEEPEST, SUPPORT, TABLE_STEP, entries
from surfsup.model.state import FRAME_TIME, State, Surroundings, free_fall_drop
from surfsup.model.sweeps import LEAST, OF_EXCESS, OF_RISE, STEP

if TYPE_CHECKING:
    from surfsup.model.simulator import Simulator


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

    def __reduce__(self) -> tuple[type[NativeStep], tuple[str]]:
        return NativeStep, (self.path,)  # a copy makes its own network

    def can_take(self, state: State, around: Surroundings, network: ConvolutionNetwork) -> bool:
        """Whether it may stand in: it is built, no gradient is wanted, all is single precision on the CPU."""
        if not self.path or torch.is_grad_enabled() or around.gravity.ndim != 1 or not network.layers:
            return False
        return all(
            value.dtype == torch.float32 and value.device.type == "cpu"
            for value in (*vars(state).values(), around.gravity, around.lower, network.encoder[0].weight)
        )

    @torch.no_grad()
    def take(self, simulator: Simulator, state: State, around: Surroundings) -> tuple[Tensor, Tensor, Look]:
        """Positions (N, 3) and velocities (N, 3) one frame later, before the guard, and where it looked at the solid.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        places, speeds = state.positions.contiguous().numpy(), state.velocities.contiguous().numpy()
        # In NumPy: torch's threads would wait for each other at every one of such small steps.
        ahead = torch.from_numpy(places + np.float32(FRAME_TIME) * speeds + free_fall_drop(around.gravity).numpy())
        distance, normal = around.distance_and_normal(ahead)
        told = (ahead, distance.float(), normal.float().contiguous(), around.gravity, around.lower, around.upper)
        positions, velocities = np.empty_like(speeds), np.empty_like(speeds)
        radius = simulator.architecture.radius
        most = most_edges(len(ahead), radius)
        edges = self.network_of(simulator).step(
            places,
            speeds,
            *(value.numpy() for value in told),
            positions,
            velocities,
            self.path,
            torch.get_num_threads(),
            most,
        )
        if edges < 0:
            raise blown_up()
        if edges > most:
            raise collapsed(radius)
        return torch.from_numpy(positions), torch.from_numpy(velocities), Look(ahead, told[1])

    def network_of(self, simulator: Simulator) -> native.Network:
        """The native network of the weights where they are now."""
        if self.of is not simulator.network:
            self.of, self.weights = simulator.network, list(simulator.network.parameters())
        where = [weight.data_ptr() for weight in self.weights]
        if self.network is None or where != self.made_of:
            self.network, self.made_of = native_network(simulator), where
        return self.network


def native_network(simulator: Simulator) -> native.Network:
    """The native twin of a simulator's network, whose weights it shares."""
    network, radius = simulator.network, simulator.architecture.radius
    density, slope = entries(torch.float32, torch.device("cpu"))

    def array(weight: Tensor) -> object:
        return weight.detach().numpy()

    first, last = network.factors[0], network.factors[2]
    return native.Network(
        encoder=(array(network.encoder[0].weight), array(network.encoder[2].weight)),
        factors=(array(first.weight), array(first.bias), array(last.weight), array(last.bias)),
        layers=[(array(one.mix.weight), array(one.own.weight), array(one.out.weight)) for one in network.layers],
        decoder=(array(network.decoder[0].weight), array(network.decoder[2].weight)),
        solids=(density.numpy(), slope.numpy(), DEEPEST, TABLE_STEP, SUPPORT),
        radius=radius,
        frame_time=FRAME_TIME,
        reach=REACH,
        displacement_scale=DISPLACEMENT_SCALE,
        velocity_scale=VELOCITY_SCALE,
        nearness_scale=NEARNESS_SCALE,
        density_scale=DENSITY_SCALE,
        own_density=own_density(radius),
        densest=DENSEST,
        sweep_time=STEP,
        of_rise=OF_RISE,
        of_excess=OF_EXCESS,
        least=LEAST,
        position_share=POSITION_SHARE,
        largest=LARGEST,
        thickest=THICKEST,
    )
