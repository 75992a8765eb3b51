import numpy as np
import torch
import trimesh

from surfsup.sdf import Box, CappedCone, Cylinder, Sphere, Torus
from surfsup.sdf.grid import SdfGrid

# The corners of the ranges of section 5.1 of the SURFSUP supplement, and their middle.
SHAPES = {
    "sphere-small": (Sphere, {"radius": 0.25}),
    "sphere-large": (Sphere, {"radius": 0.5}),
    "box-cube": (Box, {"size": (0.4, 0.4, 0.4)}),
    "box-uneven": (Box, {"size": (0.4, 0.55, 0.7)}),
    "cylinder-thin": (Cylinder, {"radius": 0.15, "height": 0.75}),
    "cylinder-fat": (Cylinder, {"radius": 0.35, "height": 0.4}),
    "cone-thin": (CappedCone, {"height": 0.7, "bottom_radius": 0.2, "top_radius": 0.01}),
    "cone-fat": (CappedCone, {"height": 0.4, "bottom_radius": 0.4, "top_radius": 0.01}),
    "cone-frustum": (CappedCone, {"height": 0.5, "bottom_radius": 0.15, "top_radius": 0.3}),
    "torus-thin": (Torus, {"major_radius": 0.4, "minor_radius": 0.1}),
    "torus-fat": (Torus, {"major_radius": 0.2, "minor_radius": 0.15}),
}


def revolved(profile):
    return trimesh.creation.revolve(np.asarray(profile, dtype=float), sections=128)


def fine_mesh(kind, parameters) -> trimesh.Trimesh:
    """The same solid as triangles, constructed without the distance function."""
    if kind is Sphere:
        return trimesh.creation.icosphere(subdivisions=5, radius=parameters["radius"])
    if kind is Box:
        return trimesh.creation.box(parameters["size"])
    if kind is Cylinder:
        radius, half = parameters["radius"], parameters["height"] / 2
        return revolved([(0, -half), (radius, -half), (radius, half), (0, half)])
    if kind is CappedCone:
        half = parameters["height"] / 2
        bottom, top = parameters["bottom_radius"], parameters["top_radius"]
        return revolved([(0, -half), (bottom, -half), (top, half), (0, half)])
    return trimesh.creation.torus(
        parameters["major_radius"], parameters["minor_radius"], major_sections=256, minor_sections=128
    )


def points_around(surface, count=2000, margin=0.3, seed=0, dtype=torch.float64) -> torch.Tensor:
    lower, upper = surface.bounds().detach().double()
    generator = torch.Generator().manual_seed(seed)
    unit = torch.rand(count, 3, generator=generator, dtype=torch.float64)
    return (lower - margin + unit * (upper - lower + 2 * margin)).to(dtype)


def sphere_grid(cell=0.1) -> SdfGrid:
    """Distances to a sphere of radius 0.8 on a grid that spans -1.2 to 1.2."""
    axis = torch.arange(round(2.4 / cell) + 1) * cell - 1.2
    nodes = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1)
    return SdfGrid.from_distances(torch.linalg.vector_norm(nodes, dim=-1) - 0.8, torch.full((3,), -1.2), cell)
