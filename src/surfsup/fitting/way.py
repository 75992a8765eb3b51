"""A way from one shape of a DeepSDF to another on which every solid is in one piece.

On the straight line between two codes a chair's legs come loose before they are a column. What lies between two chairs
that are much alike seldom does. So the way leads by known shapes that are near to each other, and steps are taken on
it only where the solid is whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import torch
from scipy.sparse.csgraph import dijkstra

from surfsup.errors import InputError
from surfsup.fitting.interpolate import RESOLUTION, Between, solid_between
from surfsup.sdf.neural.deepsdf import DeepSdf

RELUCTANCE = 3.0  # a hop costs its length to this power: several short ones rather than a long one
LOOKS = (2, 4, 8)  # for each step that is asked for, places on the way that are looked at; more where these are too few


def whole_way(shapes: DeepSdf, first: str, second: str, steps: int, resolution: int = RESOLUTION) -> Iterator[Between]:
    """``steps`` solids from the shape ``first`` to ``second``, both among them, each one connected, closed mesh.

    They are as evenly spread along the way as they can be.

    Raises:
        InputError: there are fewer than two steps, no such shape, one of the two is in pieces itself, or too few
            solids on the way are whole.
    """
    if steps < 2:
        raise InputError(f"an interpolation of {steps} steps has no two ends; give at least 2")
    for name in (first, second):
        shapes.code(name)
    ends = [shapes.names.index(name) for name in (first, second)]
    known: dict[int, Between] = {}
    for number, share in zip(ends, (0.0, 1.0), strict=True):
        known[number] = solid_between(shapes, shapes.codes[number], share, resolution)
        if not known[number].whole:
            raise InputError(
                f"{shapes.source}: '{shapes.names[number]}' is itself no single closed mesh; choose another shape"
            )
    path = path_of(shapes, ends[0], ends[1], known, resolution)
    for looks in LOOKS:
        found = along(shapes, path, looks * steps, known, resolution)
        if len(found) >= steps:
            break
    else:
        raise InputError(
            f"{shapes.source}: only {len(found)} whole solids were found from '{first}' to '{second}'; give fewer steps"
        )
    yield from spread(found, steps)


def path_of(shapes: DeepSdf, start: int, end: int, known: dict[int, Between], resolution: int) -> list[int]:
    """Numbers of the shapes that the way leads by, all of them whole; ``known`` is told what they look like."""
    cost = torch.cdist(shapes.codes, shapes.codes).double().numpy() ** RELUCTANCE
    while True:
        before = dijkstra(cost, indices=start, return_predecessors=True)[1]
        path = [end]
        while path[-1] != start:
            path.append(int(before[path[-1]]))
        unknown = [number for number in path if number not in known]
        for number in unknown:
            known[number] = solid_between(shapes, shapes.codes[number], 0.0, resolution)
        broken = [number for number in path if not known[number].whole]
        if not broken:
            return path[::-1]
        cost[broken], cost[:, broken] = 0.0, 0.0  # to this library nought is no link


def along(shapes: DeepSdf, path: list[int], looks: int, known: dict[int, Between], resolution: int) -> list[Between]:
    """The whole ones of about ``looks`` solids on the way by the shapes ``path``, in order, each with its share."""
    codes = shapes.codes[path]
    lengths = torch.linalg.vector_norm(codes[1:] - codes[:-1], dim=-1).double().numpy()
    at = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    found = [known[path[0]].at(0.0)]
    for hop, (low, high) in enumerate(pairwise(at)):
        count = max(1, round(looks * (high - low)))
        for share in np.arange(1, count) / count:
            code = torch.lerp(codes[hop], codes[hop + 1], float(share))
            found.append(solid_between(shapes, code, float(low + share * (high - low)), resolution))
        found.append(known[path[hop + 1]].at(float(high)))
    return [one for one in found if one.whole]


def spread(found: list[Between], steps: int) -> list[Between]:
    """``steps`` of ``found`` in their order, both ends among them, their shares as even as they come."""
    chosen = [0]
    for step in range(1, steps - 1):
        left = range(chosen[-1] + 1, len(found) - (steps - 1 - step))
        chosen.append(min(left, key=lambda number, aim=step / (steps - 1): abs(found[number].share - aim)))
    return [found[number] for number in [*chosen, len(found) - 1]]
