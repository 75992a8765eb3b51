"""Crossings: particles whose straight way from one frame to the next leads through a solid.

Counting them is independent of what the simulator and collision handling do, so that it shows when these fail.
"""

from __future__ import annotations

import math
from itertools import chain

import numpy as np
import torch
from torch import Tensor

from surfsup.sdf import Surface
from surfsup.sdf.native_query import distance_native
from surfsup.sph.clearance import CLEARANCE, LIPSCHITZ_BOUND
from surfsup.sph.environment import Environment
from surfsup.sph.moving import MovingBody
from surfsup.sph.open_water import OpenState
from surfsup.sph.simulator import FluidState

# With collision handling both ends of a way keep their clearance, but for creases: a way through a solid is longer.
SHORTEST = 1.8 * CLEARANCE
TOUCH = 1e-4  # meters: a way as near to the solid leads through it
MAX_ADVANCES = 256  # along a way


class CrossingCounter:
    """Counts the crossings of each step.

    A way cannot reach a solid that was further away at an earlier query than the particle has moved since then. So only
    fast particles near a solid are queried.

    Args:
        handle_collisions: whether collision handling keeps particles out of the solid. Without it short ways count.
    """

    def __init__(self, handle_collisions: bool) -> None:
        self._shortest = SHORTEST if handle_collisions else 0.0
        self._points = np.zeros((0, 3), np.float32)  # where each particle was queried last
        self._distance = np.zeros(0, np.float32)

    def count(self, before: FluidState, after: FluidState, environment: Environment) -> int:
        """The number of crossings in a step, in the units of the simulators.

        Args:
            before, after: the fluid at both ends of the step; particles that enter or leave do not count.
            environment: with the motion of what moves in the step.
        """
        first, last = common_positions(before, after)
        starts, ends = (values.detach().cpu().float().numpy() for values in (first, last))
        ways = ends - starts
        motion = environment.motion
        displacements = [] if motion is None else motion.displacements
        # Mostly no particle is fast, which its largest coordinate shows quickly.
        bound = math.sqrt(3) * max(-ways.min(), ways.max()) if len(ways) else 0.0
        if bound + max(displacements, default=0.0) <= self._shortest:
            return 0
        squares = np.einsum("ij,ij->i", ways, ways)
        fastest = math.sqrt(squares.max()) if len(squares) else 0.0
        if fastest + max(displacements, default=0.0) <= self._shortest:
            return 0
        total = self._crossings_of_still(environment.surface, starts, ends, np.sqrt(squares))
        if motion is not None:
            for body, displacement in zip(motion.bodies, displacements, strict=True):
                if fastest + displacement > self._shortest:
                    poses = motion.start[body.solid.name], motion.end[body.solid.name]
                    own = (pose.to_own(at).astype(np.float32) for pose, at in zip(poses, (starts, ends), strict=True))
                    total += self._crossings_of_body(body, *own)
        return total

    def _crossings_of_still(
        self, surface: Surface | None, starts: np.ndarray, ends: np.ndarray, lengths: np.ndarray
    ) -> int:
        """The crossings through what stands still."""
        if surface is None:
            return 0
        if len(self._points) != len(starts):
            self._points, self._distance = starts.copy(), np.zeros(len(starts), np.float32)
        fast = np.flatnonzero(lengths > self._shortest)
        moved = np.linalg.norm(starts[fast] - self._points[fast], axis=1) + lengths[fast]
        near = fast[~(LIPSCHITZ_BOUND * moved < self._distance[fast])]
        if len(near) == 0:
            return 0
        self._points[near] = starts[near]
        self._distance[near] = distance = distances(surface, starts[near])
        near = near[LIPSCHITZ_BOUND * lengths[near] >= distance]
        return trace(surface, starts[near], ends[near])

    def _crossings_of_body(self, body: MovingBody, starts: np.ndarray, ends: np.ndarray) -> int:
        """The crossings through a solid that moves, whose frame the ways are in."""
        lower, upper = body.box
        ways = np.linalg.norm(ends - starts, axis=1) > self._shortest
        meets = ((np.minimum(starts, ends) <= upper) & (np.maximum(starts, ends) >= lower)).all(axis=1)
        near = np.flatnonzero(ways & meets)
        return trace(body.solid.surface, starts[near], ends[near])


def common_positions(before: FluidState, after: FluidState) -> tuple[Tensor, Tensor]:
    """The positions (N, 3) at both ends of the particles that are in both states."""
    if isinstance(before, OpenState) and isinstance(after, OpenState) and not np.array_equal(before.ids, after.ids):
        _, first, last = np.intersect1d(before.ids, after.ids, assume_unique=True, return_indices=True)
        return before.positions[torch.from_numpy(first)], after.positions[torch.from_numpy(last)]
    return before.positions, after.positions


def trace(surface: Surface, starts: np.ndarray, ends: np.ndarray) -> int:
    """How many of the ways from ``starts`` to ``ends`` (N, 3) begin and end outside the solid and lead through it.

    Sphere tracing: half of the distance is free even where a neural distance is twice too large.
    """
    outside = np.flatnonzero((distances(surface, starts) > TOUCH) & (distances(surface, ends) > TOUCH))
    starts, ways = starts[outside], (ends - starts)[outside]
    lengths, parts, crossings = np.linalg.norm(ways, axis=1), np.zeros(len(ways), np.float32), 0
    for _ in range(MAX_ADVANCES):
        if len(parts) == 0:
            break
        distance = distances(surface, starts + parts[:, None] * ways)
        through = distance < TOUCH
        crossings += int(through.sum())
        parts = parts + np.maximum(distance, TOUCH) / LIPSCHITZ_BOUND / lengths
        going = ~through & (parts < 1)
        starts, ways, lengths, parts = starts[going], ways[going], lengths[going], parts[going]
    return crossings


def distances(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) float32 of ``points`` (N, 3) float32."""
    tensor = torch.from_numpy(np.ascontiguousarray(points))
    if len(tensor) == 0:
        return np.zeros(0, np.float32)
    with torch.no_grad():
        distance = distance_native(surface, tensor)
        if distance is None:
            parameter = next(chain(surface.parameters(), surface.buffers()), None)
            device = "cpu" if parameter is None else parameter.device
            distance = surface.distance(tensor.to(device)).cpu()
    return distance.float().numpy()
