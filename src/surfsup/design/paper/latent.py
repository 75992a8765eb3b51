"""The latent design of section 7 of the SURFSUP supplement: the code of a chair moves until the chair holds water.

The chair is a DeepSDF's. The reward is the bowl's, with its own variance, around the center of the unit sphere that
holds the chair; to it comes the Gaussian prior under which the codes were fitted, as their own mean and spread tell it,
so that the code stays one of something like a chair. The weight of the prior, the chair's size and the water are ours:
the sphere is 0.4 m in radius, and the water comes down on it at 2 m/s, as if it had fallen 0.2 m.
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
from surfsup.sdf.neural.surface import NEAR
from surfsup.sph.kernels import KERNEL_SUPPORT

VARIANCE = 0.6  # m² (supplement, section 7.1)
FRAMES = 50  # the bowl's
RADIUS = 0.4  # meters: what the unit sphere becomes
CENTER = 0.43  # meters of its center above the floor
WATER = (0.36, 0.18)  # meters, side and height of the block
BOTTOM = 0.88  # meters of the block above the floor
SPEED = 2.0  # m/s
PRIOR = 1e-3  # of the mean squared distance from the mean code, in spreads
STEP = 0.1  # of the spread of the codes
FELT = 1.5 * KERNEL_SUPPORT / RADIUS  # in the unit of the network: farther off no particle feels the chair
FARTHEST = 4.0  # spreads that any number of the code may be off the mean


def latent(file: Path, shape: str | None = None, frames: int = FRAMES) -> Task:
    """The task, from the code of one of the shapes in ``file``, over so many frames.

    Raises:
        InputError: the file is not one of a DeepSDF, holds no such shape, or too few to tell a prior.
    """
    shapes = load_deepsdf(file)
    start = shapes.code(shape)
    if len(shapes.codes) < 2:
        raise InputError(f"{file}: holds one shape, which tells no prior of codes; fit several")
    middle, spread = shapes.codes.mean(dim=0), shapes.codes.std(dim=0).clamp(min=1e-6)

    def solid(code: Tensor) -> Surface:
        # Far from its zero the network is not to be trusted; the lattice of this very code is.
        surface = shapes.surface(code)
        with torch.no_grad():
            surface.with_lattice()
        return Transformed(Moving(surface), translation=(0.0, 0.0, CENTER), scale=RADIUS)

    gathered = near((0.0, 0.0, CENTER), VARIANCE)

    def reward(end: Outcome) -> Tensor:
        return gathered(end) - PRIOR * ((end.parameters["code"] - middle) / spread).square().mean() / 2

    side, tall = WATER
    block = Block(
        min=(-side / 2, -side / 2, BOTTOM), max=(side / 2, side / 2, BOTTOM + tall), velocity=(0.0, 0.0, -SPEED)
    )
    ranges = (middle - FARTHEST * spread, middle + FARTHEST * spread)
    return Task(
        name="latent",
        shape=solid,
        parameters={"code": Parameter(start, *ranges, STEP * float(spread.mean()))},
        scene=Scene(fluid=[Fluid(block=block)], frames=frames + 1),
        reward=reward,
    )


class Moving(Surface):
    """The solid of a code whose far distances move with the code, too.

    Beyond the network's reach a distance comes from a lattice that knows one code only. But a distance changes as that
    of the nearest point of the surface does, and there the network is at home: its value at that point, which is about
    zero, lends the distance its gradient.
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
        told = distance.detach()
        far = torch.nonzero((told.abs() >= NEAR) & (told.abs() < FELT)).squeeze(-1)
        foot = (points - distance[:, None] * normal).detach()[far]
        value = self.surface.value(foot.float()).to(distance.dtype)
        return distance.index_add(0, far, value - value.detach()), normal

    @property
    def exact_outside(self) -> bool:
        """As far as the network's own is: only nearly."""
        return self.surface.exact_outside

    def bounds(self) -> Tensor:
        """The box around the solid (2, 3)."""
        return self.surface.bounds()
