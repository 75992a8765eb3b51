"""Speed and accuracy of MeshSurface, with one torch thread and with two.

    python benchmarks/mesh_distance.py MESH.obj [--up y]

Two sets of 3000 particles around the mesh, which is scaled to 0.8 m: spread over the container (1 x 1 x 2 m),
and as a pool within 0.15 m of the surface (the worst case). For comparison it times the exact query of every point,
and the nearest triangle alone, this project's and libigl's (AABB.squared_distance), in microseconds a point.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

import igl
import numpy as np
import torch

from surfsup.sdf import MeshSurface, MeshWarning, fit_mesh, load_mesh

PARTICLES = 3000
REPEATS = 30


def milliseconds(work: Callable[[], object]) -> tuple[float, float]:
    """Median and smallest time of ``work``."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return float(np.median(times)), min(times)


def particle_sets(exact: MeshSurface) -> dict[str, torch.Tensor]:
    """Both sets of points (3000, 3), all outside the mesh."""
    rng = np.random.default_rng(0)
    low, high = exact.bounds().numpy()
    spread = torch.as_tensor(rng.uniform([-0.5, -0.5, 0], [0.5, 0.5, 2], (2 * PARTICLES, 3)), dtype=torch.float32)
    close = torch.as_tensor(rng.uniform(low - 0.15, high + 0.15, (60_000, 3)), dtype=torch.float32)
    distance = exact.distance(close)
    pool = close[(distance > 0) & (distance < 0.15)]
    return {"container": spread[exact.distance(spread) > 0][:PARTICLES], "pool": pool[:PARTICLES]}


def errors(surface: MeshSurface, exact: MeshSurface, points: torch.Tensor) -> list[str]:
    """A line for each range of distance: how far distance and normal are from the exact ones."""
    distance, normal = surface.distance_and_normal(points)
    true_distance, true_normal = exact.distance_and_normal(points)
    off = (distance - true_distance).abs()
    angle = torch.rad2deg(torch.acos((normal * true_normal).sum(dim=1).clamp(-1, 1)))
    lines = []
    for near, far in ((0, 0.025), (0.025, 0.1), (0.1, 0.2), (0.2, 0.8), (0.8, 9)):
        here = (true_distance >= near) & (true_distance < far)
        if here.any():
            o, a = off[here], angle[here]
            wrong = int((torch.sign(distance[here]) != torch.sign(true_distance[here])).sum())
            lines.append(
                f"  {near:6.4f} - {far:6.4f} m: {int(here.sum()):5d} points, off by mean {o.mean():.1e} "
                f"99 % {o.quantile(0.99):.1e} max {o.max():.1e} m, normal mean {a.mean():.2f} "
                f"99 % {a.quantile(0.99):.1f} degrees, wrong signs {wrong}"
            )
    return lines


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh")
    parser.add_argument("--up", choices=("y", "z"))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", MeshWarning)
    start = time.perf_counter()
    mesh, _ = fit_mesh(load_mesh(arguments.mesh, up=arguments.up), 0.8)
    loaded = time.perf_counter()
    surface, exact = MeshSurface(mesh), MeshSurface(mesh, exact=True)
    trees = time.perf_counter()
    surface.build_grids()
    built = time.perf_counter()
    print(
        f"{len(mesh.faces)} triangles: read {loaded - start:.2f} s, trees {(trees - loaded) / 2:.2f} s, "
        f"grids {built - trees:.2f} s"
    )
    tree = igl.AABB()
    tree.init(exact.query.vertices, exact.query.faces)
    sets = particle_sets(exact)
    for name, points in sets.items():
        for threads in (1, 2):
            torch.set_num_threads(threads)
            ours, best = milliseconds(lambda p=points: surface.distance_and_normal(p))
            plain, plain_best = milliseconds(lambda p=points: exact.distance_and_normal(p))
            print(
                f"{name}: {len(points)} points, {threads} threads: {ours:.2f} ms (best {best:.2f}), "
                f"every point by the mesh {plain:.2f} ms (best {plain_best:.2f})"
            )
            places = points.double().numpy()
            nearest, _ = milliseconds(lambda p=places: exact.query.nearest(p))
            peer, _ = milliseconds(lambda p=places: tree.squared_distance(exact.query.vertices, exact.query.faces, p))
            each = 1000 / len(points)
            print(f"  nearest triangle: {each * nearest:.2f} microseconds a point, libigl's {each * peer:.2f}")
        print("\n".join(errors(surface, exact, points)))


if __name__ == "__main__":
    main()
