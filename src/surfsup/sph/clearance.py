"""What collision handling keeps and returns, in C++ and in Warp alike."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

# Meters from solid and walls to a particle's center. The reference's water comes no nearer than 21.8 mm.
CLEARANCE = 0.020
ROUNDS = 4
TOLERANCE = 1e-5  # meters by which a particle may fall short of its clearance
LIPSCHITZ_BOUND = 2.0  # of signed distances: a neural one may exceed the true distance by this factor


@dataclass(frozen=True)
class LastQuery:
    """Where each particle last queried the solid.

    Attributes:
        positions: (N, 3) of the particles then, meters.
        distance: (N,) to the solid there, meters.
    """

    positions: Tensor
    distance: Tensor


@dataclass(frozen=True)
class CollisionResult:
    """The particles after collision handling.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        collided: (N,) bool, which particles were moved.
    """

    positions: Tensor
    velocities: Tensor
    collided: Tensor
