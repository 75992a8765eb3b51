"""A path from one shape of a DeepSDF to another on which every solid is a single closed mesh.

On the straight line between two codes the solid often falls apart: a chair loses its legs. Between two similar shapes
that is rare. The path therefore goes through known shapes that are near each other, and only connected solids on it
are returned.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import torch
from scipy.sparse.csgraph import dijkstra

from surfsup.errors import InputError
from surfsup.fitting.interpolate import RESOLUTION, InterpolatedSolid, interpolated_solid
from surfsup.sdf.neural.deepsdf import DeepSdf

LENGTH_EXPONENT = 3.0  # a hop costs its length to this power, which prefers several short hops to a long one
SAMPLES_PER_STEP = (2, 4, 8)  # solids that are tried for each step; the next number if too few are connected


def interpolate_connected(
    shapes: DeepSdf, first: str, second: str, steps: int, resolution: int = RESOLUTION
) -> Iterator[InterpolatedSolid]:
    """``steps`` solids from the shape ``first`` to ``second``, both included, each a single closed mesh.

    They are spaced along the path as evenly as possible.

    Raises:
        InputError: there are fewer than two steps, a shape is unknown or not a single closed mesh itself, or too few
            solids on the path are connected.
    """
    if steps < 2:
        raise InputError(f"an interpolation of {steps} steps has no two ends; give at least 2")
    for name in (first, second):
        shapes.code(name)
    start, end = shapes.names.index(first), shapes.names.index(second)
    solids: dict[int, InterpolatedSolid] = {}
    for number, fraction in ((start, 0.0), (end, 1.0)):
        solids[number] = interpolated_solid(shapes, shapes.codes[number], fraction, resolution)
        if not solids[number].whole:
            raise InputError(
                f"{shapes.source}: '{shapes.names[number]}' is itself no single closed mesh; choose another shape"
            )
    path = shortest_path(shapes, start, end, solids, resolution)
    for samples in SAMPLES_PER_STEP:
        found = sample_path(shapes, path, samples * steps, solids, resolution)
        if len(found) >= steps:
            break
    else:
        raise InputError(
            f"{shapes.source}: only {len(found)} whole solids were found from '{first}' to '{second}'; give fewer steps"
        )
    yield from evenly_spaced(found, steps)


def shortest_path(
    shapes: DeepSdf, start: int, end: int, solids: dict[int, InterpolatedSolid], resolution: int
) -> list[int]:
    """The numbers of the connected shapes on the cheapest path; adds their solids to ``solids``."""
    cost = torch.cdist(shapes.codes, shapes.codes).double().numpy() ** LENGTH_EXPONENT
    while True:
        predecessors = dijkstra(cost, indices=[start], return_predecessors=True)[1][0]
        path = [end]
        while path[-1] != start:
            path.append(int(predecessors[path[-1]]))
        for number in path:
            if number not in solids:
                solids[number] = interpolated_solid(shapes, shapes.codes[number], 0.0, resolution)
        broken = [number for number in path if not solids[number].whole]
        if not broken:
            return path[::-1]
        cost[broken], cost[:, broken] = 0.0, 0.0  # dijkstra() takes zero for a missing edge


def sample_path(
    shapes: DeepSdf, path: list[int], count: int, solids: dict[int, InterpolatedSolid], resolution: int
) -> list[InterpolatedSolid]:
    """The connected ones among about ``count`` solids along the shapes ``path``, in order."""
    codes = shapes.codes[path]
    lengths = torch.linalg.vector_norm(codes[1:] - codes[:-1], dim=-1).double().numpy()
    at = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    found = [solids[path[0]].at(0.0)]
    for hop, (low, high) in enumerate(pairwise(at)):
        samples = max(1, round(count * (high - low)))
        for share in np.arange(1, samples) / samples:
            code = torch.lerp(codes[hop], codes[hop + 1], float(share))
            found.append(interpolated_solid(shapes, code, float(low + share * (high - low)), resolution))
        found.append(solids[path[hop + 1]].at(float(high)))
    return [one for one in found if one.whole]


def evenly_spaced(found: list[InterpolatedSolid], steps: int) -> list[InterpolatedSolid]:
    """``steps`` of the solids ``found``, in order and with both ends, whose fractions are spaced most evenly."""
    chosen = [0]
    for step in range(1, steps - 1):
        target = step / (steps - 1)
        candidates = range(chosen[-1] + 1, len(found) - (steps - 1 - step))
        distances = [abs(found[number].fraction - target) for number in candidates]
        chosen.append(candidates[int(np.argmin(distances))])
    return [found[number] for number in [*chosen, len(found) - 1]]
