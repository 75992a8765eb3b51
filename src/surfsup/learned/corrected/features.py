"""The network's input: quantities of each particle from the solver's last substep."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.scene import FRAME_TIME
from surfsup.sph.solver import Observation

DISPLACEMENT_SCALE = 1e-4  # meters: standard deviation of the solver's error after a frame (measured)
# Standard deviations of the features in a splash. Features of similar size are learned faster (measured).
VELOCITY_SCALE = 0.3  # m/s
GRADIENT_SCALE = 20.0  # 1/m
DENSITY_SCALE = 0.02  # of the rest density
# The largest magnitudes of the kernel sums in trajectories of the reference. Larger sums, which training never
# contains, would give factors that throw particles out of the water.
MAX_SUMS = (3.0, 2.5, 2.5, 2.5, 4.0, 1.5)

PARTICLE_FEATURES = 14
NEIGHBORHOOD_FEATURES = 6


def particle_features(observation: Observation) -> Tensor:
    """Features (N, 14) that vanish where nothing but gravity acts.

    Columns: change of velocity (3) and of position (3) by the solver against ballistic motion, gradient of the boundary
    density (3), neighbors' velocity relative to the particle's, weighted by the kernel (3), density error where
    positive (1), density rate (1). Absolute velocities are no feature, so that the features are Galilean invariant.
    """
    substep = observation.substep
    columns = [
        observation.delta_velocity / VELOCITY_SCALE,
        observation.delta_position / (FRAME_TIME * VELOCITY_SCALE),
        substep.boundary_gradient / GRADIENT_SCALE,
        substep.velocity_difference / VELOCITY_SCALE,
        substep.density_error.clamp(min=0)[:, None] / DENSITY_SCALE,
        scaled_density_rate(observation)[:, None],
    ]
    return torch.cat(columns, dim=-1)


def neighborhood_features(observation: Observation) -> Tensor:
    """Features (N, 6) of the arrangement of neighbors, clamped to the range of the reference's trajectories.

    Columns: kernel sum (1) and gradient sum (3), sum of squared gradients (1), boundary density (1).
    """
    substep = observation.substep
    columns = [
        substep.kernel_sum[:, None],
        substep.gradient_sum,
        substep.squared_gradient_sum[:, None],
        substep.boundary_density[:, None],
    ]
    sums = torch.cat(columns, dim=-1)
    bound = sums.new_tensor(MAX_SUMS)
    return torch.minimum(torch.maximum(sums, -bound), bound)


def scaled_density_rate(observation: Observation) -> Tensor:
    """The density rate (N,) per frame in ``DENSITY_SCALE``."""
    return observation.substep.density_rate * FRAME_TIME / DENSITY_SCALE
