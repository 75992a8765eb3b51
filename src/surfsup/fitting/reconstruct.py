"""Reconstruction of a new shape by a trained DeepSDF: optimization of the latent code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.fitting.deepsdf_fit import clamped_error
from surfsup.sdf.neural.deepsdf import DeepSdf

STEPS = 400
LEARNING_RATE = 0.02
BATCH = 2048  # points a step
PRIOR = 1e-4  # weight of |z|²
INITIAL_POINTS = 512  # points that the initial code is chosen by
CODES_AT_ONCE = 64  # limits the memory of that choice


@dataclass(frozen=True)
class Reconstruction:
    """A code and its error.

    Attributes:
        code: (C,).
        error: mean error of the clamped distances, in units of the cube.
        nearest: name of the fitted shape whose code the optimization started from.
    """

    code: Tensor
    error: float
    nearest: str


def reconstruct(
    shapes: DeepSdf,
    points: Tensor,
    distance: Tensor,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Reconstruction:
    """Find the code whose solid has the distances (K,) at ``points`` (K, 3), by gradient descent on the code alone.

    The descent starts at the code of the most similar fitted shape. The prior of the fit keeps it near the origin
    (Park et al., 2019, equation 10).
    """
    random = torch.Generator().manual_seed(seed)
    first = nearest_code(shapes, points[:INITIAL_POINTS], distance[:INITIAL_POINTS])
    code = shapes.codes[first].clone().requires_grad_()
    optimizer = torch.optim.Adam([code], lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS)
    for step in range(STEPS):
        batch = torch.randint(len(points), (BATCH,), generator=random)
        value = shapes.network.value(points[batch][None], code[None])[0]
        loss = clamped_error(value, distance[batch]) + PRIOR * code.square().sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        progress(step + 1, STEPS)
    code = code.detach()
    with torch.no_grad():
        error = float(clamped_error(shapes.network.value(points[None], code[None])[0], distance))
    return Reconstruction(code, error, shapes.names[first])


def nearest_code(shapes: DeepSdf, points: Tensor, distance: Tensor) -> int:
    """The number of the fitted shape with the least error of the distances (K,) at ``points`` (K, 3)."""
    errors = []
    with torch.no_grad():
        for codes in shapes.codes.split(CODES_AT_ONCE):
            value = shapes.network.value(points.expand(len(codes), -1, -1), codes)
            errors += [float(clamped_error(one, distance)) for one in value]
    return int(torch.tensor(errors).argmin())
