"""How well a DeepSDF reconstructs chairs that it was not fitted to, and what lies between two that it was.

    python benchmarks/deepsdf_unseen.py chairs.safetensors chairs [--fitted 50] [--unseen 50] [--pairs 10]

The project's own chairs (or bowls) are drawn by number, so those from 500 on were not in a fit to the first 500.
Chamfer distances are plain (mean + mean) between 20,000 points on each surface, in a cube of side 2; those of the
fitted shapes are by the codes that the fit left. Interpolations have nine steps, both ends among them: along the
straight line between two random codes, and by way of known shapes (`surfsup fit between --whole`) between two random
shapes that are each one closed mesh themselves; those passed over are counted. Meshes are of 64 cells along the cube.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.fitting.deepsdf_fit import samples_of
from surfsup.fitting.exact import Exact
from surfsup.fitting.interpolate import interpolate, solid_between
from surfsup.fitting.reconstruct import reconstruct
from surfsup.fitting.shape_set import shape_set
from surfsup.fitting.siren_result import chamfer
from surfsup.fitting.way import whole_way
from surfsup.sdf import DeepSdf, load_deepsdf, polygonize

FIRST_UNSEEN = 500
POINTS = 20_000
RESOLUTION = 64
STEPS = 9


def chamfer_of(shapes: DeepSdf, code: torch.Tensor, exact: Exact) -> float:
    """Between the mesh of a code and the true surface; NaN where the code has no inside."""
    try:
        mesh = polygonize(shapes.surface(code), RESOLUTION)
    except InputError:
        return float("nan")
    true = exact.on_surface(POINTS, np.random.default_rng(0)).points
    return chamfer(np.asarray(mesh.sample(POINTS, seed=0)), true)


def told(name: str, found: list[float]) -> float:
    """Print mean and median of Chamfer distances; returns the mean."""
    missing = int(np.isnan(found).sum())
    mean = float(np.nanmean(found))
    print(f"{name}: {len(found)} shapes, Chamfer mean {mean:.4f}, median {np.nanmedian(found):.4f}, {missing} empty")
    return mean


def random_pairs(shapes: DeepSdf) -> Iterator[tuple[str, str]]:
    """Names of two different shapes, again and again."""
    random = np.random.default_rng(0)
    while True:
        first, second = random.choice(len(shapes.names), 2, replace=False)
        yield shapes.names[first], shapes.names[second]


def straight_lines(shapes: DeepSdf, pairs: int) -> None:
    """Print how many straight lines between random codes are whole at every step."""
    whole = 0
    for first, second in islice(random_pairs(shapes), pairs):
        steps = list(interpolate(shapes, shapes.code(first), shapes.code(second), STEPS, RESOLUTION))
        parts = " ".join(f"{step.parts}{'' if step.closed else ' open'}" for step in steps)
        whole += all(step.whole for step in steps)
        print(f"{first} to {second}: parts of each step {parts}", flush=True)
    print(f"{whole} of {pairs} straight lines are one connected, closed mesh at every step", flush=True)


def whole_ways(shapes: DeepSdf, pairs: int) -> None:
    """Print how many ways by known shapes are whole at every step, and how many pairs had an end that is not."""
    whole = tried = passed_over = 0
    for first, second in random_pairs(shapes):
        if tried == pairs:
            break
        if not all(solid_between(shapes, shapes.code(name), 0.0, RESOLUTION).whole for name in (first, second)):
            passed_over += 1
            continue
        tried += 1
        try:
            steps = list(whole_way(shapes, first, second, STEPS, RESOLUTION))
        except InputError as error:
            print(error)
            continue
        whole += all(step.whole for step in steps)
        print(f"{first} to {second}: shares of the steps {' '.join(f'{step.share:.2f}' for step in steps)}", flush=True)
    print(f"{whole} of {pairs} ways by known shapes are; {passed_over} pairs were passed over, an end of theirs is not")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shapes", type=Path)
    parser.add_argument("source", choices=("chairs", "bowls"))
    parser.add_argument("--fitted", type=int, default=50)
    parser.add_argument("--unseen", type=int, default=50)
    parser.add_argument("--pairs", type=int, default=10)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    shapes = load_deepsdf(arguments.shapes)
    seen = shape_set(arguments.source, None, arguments.fitted)
    seen_chamfer = told("fitted", [chamfer_of(shapes, shapes.code(name), seen.exact(name)) for name in seen.names])
    unseen = shape_set(arguments.source, None, arguments.unseen, first=FIRST_UNSEEN)
    found = []
    for number, name in enumerate(unseen.names):
        exact = unseen.exact(name)
        points, distance = samples_of(exact, np.random.default_rng([9, number]))
        found.append(chamfer_of(shapes, reconstruct(shapes, points, distance).code, exact))
    print(f"ratio {told('unseen', found) / seen_chamfer:.3f}")
    straight_lines(shapes, arguments.pairs)
    whole_ways(shapes, arguments.pairs)


if __name__ == "__main__":
    main()
