"""Speed and accuracy of a SIREN beside the mesh that it was fitted to, queried exactly and baked into grids.

    python benchmarks/neural_distance.py dragon.safetensors dragon.obj [--up y] [--grids 64 128 256] [--plot FILE.png]

Distance and normal of 3,000 points, all within |d| < 0.1 of the cube of side 2 (the worst case), and spread over
the whole cube as water would be. Times are processor time with one thread and wall time with two; the
least of several, so that other load on the machine counts little. Errors are means against the exact distance.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np
import torch
import trimesh
from torch import Tensor, nn

from surfsup.fitting.exact_shape import DistanceSamples, ExactMesh
from surfsup.sdf import MeshSurface, load_mesh, load_siren
from surfsup.sdf.mesh.grid_distances import mesh_distances

PARTICLES = 3000
REPEATS = 20
SERIES = {"libigl": "#24313d", "SIREN": "#b35c31", "our own": "#5b8f3a", "baked": "#2f7ebc"}  # the first that fits

Answer = Callable[[Tensor], tuple[Tensor, Tensor]]


def milliseconds(work: Callable[[], object], clock: Callable[[], float]) -> float:
    """The least time of ``work`` by ``clock``."""
    times = []
    for _ in range(REPEATS):
        start = clock()
        work()
        times.append(1e3 * (clock() - start))
    return min(times)


def baked(exact: ExactMesh, cells: int) -> Answer:
    """The mesh as a grid of ``cells`` along the cube, interpolated by torch; the normal by differences of nodes."""
    values, _, lower = (value.float() for value in mesh_distances(exact.query, 2 / cells, 0.12))
    table = torch.stack([values, *torch.gradient(values, spacing=2 / cells)])[None]
    shape = torch.tensor(values.shape)

    def answer(points: Tensor) -> tuple[Tensor, Tensor]:
        place = 2 * (points - lower) / (2 / cells) / (shape - 1) - 1
        found = nn.functional.grid_sample(
            table, place.flip(-1)[None, None, None], align_corners=True, padding_mode="border"
        )[0, :, 0, 0]
        return found[0], nn.functional.normalize(found[1:].T, dim=-1)

    return answer


Nearest = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def libigl(exact: ExactMesh) -> Nearest:
    """The nearest triangle by libigl's tree."""
    vertices, faces = exact.query.vertices, exact.query.faces
    tree = igl.AABB()
    tree.init(vertices, faces)

    def nearest(places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        squared, face, closest = tree.squared_distance(vertices, faces, places)
        return np.sqrt(squared), face, closest

    return nearest


def exactly(exact: ExactMesh, nearest: Nearest) -> Answer:
    """The exact distance of every point; inside and outside by libigl's winding number."""

    def answer(points: Tensor) -> tuple[Tensor, Tensor]:
        places = points.double().numpy()
        distance, face, closest = nearest(places)
        inside = exact.query.inside(places)
        normal = exact.query.normal(places, distance, face, closest, inside)
        return torch.from_numpy(np.where(inside, -distance, distance)), torch.from_numpy(normal)

    return answer


def measure(name: str, answer: Answer, sets: dict[str, DistanceSamples]) -> tuple[float, float]:
    """Print a row; returns milliseconds and mean angle on the points near the surface."""
    row = [f"{name:34s}"]
    shown = (0.0, 0.0)
    for label, known in sets.items():
        points = torch.from_numpy(known.points).float()
        distance, normal = (values.double().numpy() for values in answer(points))
        angle = np.degrees(np.arccos(np.clip((normal * known.normals).sum(axis=1), -1, 1))).mean()
        torch.set_num_threads(1)
        one = milliseconds(lambda points=points: answer(points), time.process_time)
        torch.set_num_threads(2)
        two = milliseconds(lambda points=points: answer(points), time.perf_counter)
        torch.set_num_threads(1)
        off = np.abs(distance - known.distance).mean()
        row.append(f"{label}: {one:6.1f} / {two:6.1f} ms, off {off:.1e}, {angle:5.2f} degrees")
        if label == "near":
            shown = (one, float(angle))
    print("   ".join(row), flush=True)
    return shown


def plot(path: Path, rows: dict[str, tuple[float, float]]) -> None:
    """Accuracy against time, a point a way."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5))
    for number, (name, (time_taken, angle)) in enumerate(rows.items()):
        color = next(color for kind, color in SERIES.items() if kind in name)
        axes.scatter(time_taken, angle, s=45, color=color)
        above = number % 2 == 0  # so that neighbors do not write over each other
        place = {"xytext": (6, 5 if above else -12), "textcoords": "offset points"}
        axes.annotate(name, (time_taken, angle), fontsize=8, **place)
    axes.set_xscale("log")
    axes.set_xlabel("ms for 3,000 points near the surface, distance and normal, one thread")
    axes.set_ylabel("mean error of the normal, degrees")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(bottom=-1)
    axes.margins(x=0.25, y=0.12)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("siren", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--up", choices=("y", "z"))
    parser.add_argument("--grids", type=int, nargs="+", default=[64, 128, 256], help="cells of baked grids, a side")
    parser.add_argument("--plot", type=Path)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    surface = load_siren(arguments.siren)
    exact = ExactMesh(load_mesh(arguments.mesh, up=arguments.up))
    random = np.random.default_rng(0)
    every = exact.sample_cube(2 * PARTICLES, 1.0, random)
    outside = every.only(np.flatnonzero(every.distance > 0)[:PARTICLES])
    sets = {"near": exact.sample_near(PARTICLES, random), "anywhere": outside}

    def network_alone(points: Tensor) -> tuple[Tensor, Tensor]:
        with torch.no_grad():
            value, gradient = surface.value_and_gradient(points)
        return value, nn.functional.normalize(gradient, dim=-1)

    mesh = MeshSurface(trimesh.Trimesh(exact.query.vertices, exact.query.faces, process=False))
    ways: dict[str, Answer] = {
        "exact, libigl": exactly(exact, libigl(exact)),
        "exact, our own": exactly(exact, exact.query.nearest),
        "our own near, grids far": mesh.distance_and_normal,
    }
    ways |= {f"baked grid of {cells}": baked(exact, cells) for cells in arguments.grids}
    ways |= {"SIREN alone": network_alone, "SIREN near, grid far": surface.distance_and_normal}
    rows = {name: measure(name, answer, sets) for name, answer in ways.items()}
    if arguments.plot is not None:
        plot(arguments.plot, rows)


if __name__ == "__main__":
    main()
