"""A shape that a DeepSDF was not fitted to, by the code that suits it best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.fitting.deepsdf_fit import clamped_error
from surfsup.sdf.neural.deepsdf import DeepSdf

STEPS = 400
LEARNING_RATE = 0.02
POINTS = 2048  # in a step
PRIOR = 1e-4
TRIED = 512  # points by which the code to start from is chosen
AT_ONCE = 64  # codes tried at once


@dataclass(frozen=True)
class Reconstruction:
    """A code and how well it does.

    Attributes:
        code: (C,).
        error: mean difference of the clamped distances, in units of the cube.
        nearest: name of the fitted shape that the search started from.
    """

    code: Tensor
    error: float
    nearest: str


def reconstruct(
    shapes: DeepSdf,
    points: Tensor,
    distance: Tensor,
    seed: int = 0,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> Reconstruction:
    """The code whose solid has the distances (K,) at ``points`` (K, 3), by gradient descent on the code alone.

    It starts from the code of the fitted shape that is nearest, and stays near the origin by the same prior as in the
    fit (Park et al., 2019, equation 10).
    """
    random = torch.Generator().manual_seed(seed)
    first = nearest_code(shapes, points[:TRIED], distance[:TRIED])
    code = shapes.codes[first].clone().requires_grad_()
    optimizer = torch.optim.Adam([code], lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS)
    for step in range(STEPS):
        pick = torch.randint(len(points), (POINTS,), generator=random)
        value = shapes.network.value(points[pick][None], code[None])[0]
        loss = clamped_error(value, distance[pick]) + PRIOR * code.square().sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        tell(step + 1, STEPS)
    code = code.detach()
    with torch.no_grad():
        error = float(clamped_error(shapes.network.value(points[None], code[None])[0], distance))
    return Reconstruction(code, error, shapes.names[first])


def nearest_code(shapes: DeepSdf, points: Tensor, distance: Tensor) -> int:
    """The number of the fitted shape whose distances at ``points`` (K, 3) are nearest to ``distance`` (K,)."""
    off = []
    with torch.no_grad():
        for codes in shapes.codes.split(AT_ONCE):
            value = shapes.network.value(points.expand(len(codes), -1, -1), codes)
            off += [float(clamped_error(one, distance)) for one in value]
    return int(torch.tensor(off).argmin())
