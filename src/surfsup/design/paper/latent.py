"""The latent design of the SURFSUP supplement, section 7: the latent code of a chair, optimized to hold water.

The chair is a DeepSDF. The reward is that of the bowl, with its own variance, around the center of the chair's unit
sphere, plus the log of the Gaussian prior under which the codes were fitted, with their mean and standard deviation, so
that the shape stays a chair. Weight of the prior, size of the chair and water are our choice: the sphere has a radius
of 0.4 m, and the water hits it at 2 m/s, as after a fall of 0.2 m.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from surfsup.design.parameter import Parameter
from surfsup.design.reward import Outcome, near
from surfsup.design.task import Task
from surfsup.errors import InputError
from surfsup.native.dispatch import needs_gradient
from surfsup.scene import Block, Fluid, Scene
from surfsup.sdf import Surface, Transformed
from surfsup.sdf.neural.deepsdf import DeepSdfSurface, load_deepsdf
from surfsup.sdf.neural.surface import NETWORK_RANGE
from surfsup.sph.kernels import KERNEL_SUPPORT

VARIANCE = 0.6  # m² (supplement, section 7.1)
FRAMES = 50  # as for the bowl
RADIUS = 0.4  # meters, of the scaled unit sphere
CENTER = 0.43  # meters of its center above the floor
WATER = (0.36, 0.18)  # meters, side and height of the block
BOTTOM = 0.88  # meters of the block above the floor
SPEED = 2.0  # m/s
PRIOR_WEIGHT = 1e-3  # of the mean squared deviation of the code, in standard deviations
STEP = 0.1  # in standard deviations of the codes
GRADIENT_RANGE = 1.5 * KERNEL_SUPPORT / RADIUS  # in the network's unit; a surface beyond it does not act on a particle
MAX_DEVIATION = 4.0  # bound of each element of the code, in standard deviations from the mean


def latent(file: Path, shape: str | None = None, frames: int = FRAMES) -> Task:
    """The task, starting with the code of a shape in ``file``, with this number of frames.

    Raises:
        InputError: the file is not a DeepSDF, has no such shape, or has too few shapes for a prior.
    """
    shapes = load_deepsdf(file)
    start = shapes.code(shape)
    if len(shapes.codes) < 2:
        raise InputError(f"{file}: contains one shape, too few for a prior of codes; fit several")
    mean, std = shapes.codes.mean(dim=0), shapes.codes.std(dim=0).clamp(min=1e-6)

    def chair(code: Tensor) -> Surface:
        # The network is inaccurate far from its zero set; the grid belongs to this code alone.
        surface = shapes.surface(code)
        with torch.no_grad():
            surface.with_grid()
        return Transformed(DifferentiableShape(surface), translation=(0.0, 0.0, CENTER), scale=RADIUS)

    water_reward = near((0.0, 0.0, CENTER), VARIANCE)

    def reward(end: Outcome) -> Tensor:
        return water_reward(end) - PRIOR_WEIGHT * ((end.parameters["code"] - mean) / std).square().mean() / 2

    side, height = WATER
    block = Block(
        min=(-side / 2, -side / 2, BOTTOM), max=(side / 2, side / 2, BOTTOM + height), velocity=(0.0, 0.0, -SPEED)
    )
    bounds = (mean - MAX_DEVIATION * std, mean + MAX_DEVIATION * std)
    return Task(
        name="latent",
        shape=chair,
        parameters={"code": Parameter(start, *bounds, STEP * float(std.mean()))},
        scene=Scene(fluid=[Fluid(block=block)], frames=frames + 1),
        reward=reward,
    )


class DifferentiableShape(Surface):
    """A DeepSDF whose distances are differentiable with respect to the code everywhere.

    Beyond the network's range distances come from a grid of one code, without gradient. But a distance changes like
    that of the closest point on the surface, where the network is accurate. Its value there, about zero, provides
    the gradient.
    """

    def __init__(self, surface: DeepSdfSurface) -> None:
        super().__init__()
        self.surface = surface

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,)."""
        return self.distance_and_normal(points)[0]

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3)."""
        distance, normal = self.surface.distance_and_normal(points)
        if not needs_gradient(points, module=self):
            return distance, normal
        magnitude = distance.detach().abs()
        far = torch.nonzero((magnitude >= NETWORK_RANGE) & (magnitude < GRADIENT_RANGE)).squeeze(-1)
        closest = (points - distance[:, None] * normal).detach()[far]
        value = self.surface.value(closest.float()).to(distance.dtype)
        return distance.index_add(0, far, value - value.detach()), normal

    @property
    def exact_outside(self) -> bool:
        """As for the network."""
        return self.surface.exact_outside

    def bounds(self) -> Tensor:
        """A box (2, 3) that contains the solid."""
        return self.surface.bounds()
