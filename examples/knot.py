"""Writes knot.obj: a trefoil knot on a pedestal with a dish, the surface of `make demo`.

    python examples/knot.py

It shows how to make a closed mesh of any signed distance function: sample it on a grid and contour its zero level.
"""

from pathlib import Path

import numpy as np
import pyvista as pv
import trimesh
from scipy.spatial import cKDTree

TUBE = 0.052  # meters, radius of the knot's tube
KNOT_SCALE = 0.105  # meters per unit of the curve below
KNOT_CENTER = np.array([0.0, 0.0, 0.385])
BLEND = 0.04  # meters, width of the smooth transition from knot to pedestal
CELL = 0.009  # meters, grid spacing
TRIANGLES = 16_000


def trefoil(turns: np.ndarray) -> np.ndarray:
    """Points (N, 3) of an upright trefoil on two of its lobes, for `turns` (N,) in [0, 1]."""
    t = 2 * np.pi * turns
    across, depth, up = np.sin(t) + 2 * np.sin(2 * t), 1.25 * np.sin(3 * t), 2 * np.cos(2 * t) - np.cos(t)
    return KNOT_CENTER + KNOT_SCALE * np.stack([across, depth, up], axis=-1)


def knot_distance(points: np.ndarray) -> np.ndarray:
    """Signed distance (N,) in meters from `points` (N, 3) to the knot's tube, negative inside."""
    curve = trefoil(np.linspace(0, 1, 4000, endpoint=False))
    return cKDTree(curve).query(points)[0] - TUBE


def pedestal_distance(points: np.ndarray) -> np.ndarray:
    """Approximate signed distance (N,) to a round pedestal with a shallow dish in its top."""

    def rounded_cylinder(radius: float, bottom: float, top: float, rounding: float) -> np.ndarray:
        beyond_side = np.hypot(points[:, 0], points[:, 1]) - radius + rounding
        beyond_end = np.abs(points[:, 2] - (bottom + top) / 2) - (top - bottom) / 2 + rounding
        outside = np.hypot(np.maximum(beyond_side, 0), np.maximum(beyond_end, 0))
        return outside + np.minimum(np.maximum(beyond_side, beyond_end), 0) - rounding

    foot = rounded_cylinder(radius=0.30, bottom=0.0, top=0.07, rounding=0.015)
    drum = rounded_cylinder(radius=0.36, bottom=0.05, top=0.17, rounding=0.03)
    dish = np.linalg.norm(points - [0.0, 0.0, 0.95], axis=-1) - 0.84  # a ball, cut out of the drum's top
    return -smooth_minimum(-smooth_minimum(foot, drum, 0.02), dish, 0.02)


def smooth_minimum(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """Union of two distances with a smooth transition of `width` meters (polynomial smooth minimum of I. Quilez)."""
    mix = np.maximum(width - np.abs(a - b), 0) / width
    return np.minimum(a, b) - mix**2 * width / 4


def knot_mesh() -> trimesh.Trimesh:
    """The closed mesh in meters; its foot is at z = 0."""
    # The offset of a third keeps samples off the flat faces: a distance of exactly 0 would give degenerate triangles.
    low, high = np.array([-0.41, -0.41, -0.03]) + CELL / 3, np.array([0.41, 0.41, 0.82])
    grid = pv.ImageData(dimensions=np.ceil((high - low) / CELL).astype(int), spacing=[CELL] * 3, origin=low)
    points = np.asarray(grid.points)
    grid["distance"] = smooth_minimum(knot_distance(points), pedestal_distance(points), BLEND)
    surface = grid.contour([0.0], scalars="distance")
    surface = surface.decimate(1 - TRIANGLES / surface.n_cells)  # fewer triangles on flat parts
    mesh = trimesh.Trimesh(surface.points, surface.faces.reshape(-1, 4)[:, 1:])
    if mesh.volume < 0:
        mesh.invert()
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    return mesh


if __name__ == "__main__":
    mesh = knot_mesh()
    file = Path(__file__).with_name("knot.obj")
    mesh.export(file, include_normals=False, digits=5, header="made by knot.py")
    print(f"{file}: {len(mesh.faces)} triangles, {mesh.extents.round(3)} m")
