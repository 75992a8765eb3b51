"""Warp's queries of meshes and terrain, on its CPU device, against those of the CPU."""

from copy import deepcopy

import numpy as np
import pytest
import torch
import trimesh

from surfsup.sdf import Heightfield, MeshSurface
from surfsup.sdf.mesh.device_kernels import mesh_kernels
from tests.warp_compilation import assert_compile

DTYPES = [torch.float32, torch.float64]


def hilly() -> Heightfield:
    axis = np.linspace(0, 6, 24)
    return Heightfield(np.sin(axis)[:, None] * np.cos(axis), (1.0, 0.8), 0.1, 0.2)


def open_box() -> MeshSurface:
    """A box without its top: its inside follows from winding numbers."""
    box = trimesh.creation.box((0.4, 0.3, 0.2))
    return MeshSurface(trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5]), cells=24)


SOLIDS = {
    "torus": lambda: MeshSurface(trimesh.creation.torus(0.3, 0.1), cells=24),
    "far away": lambda: MeshSurface(trimesh.creation.box((0.2, 0.2, 0.4)).apply_translation((50, 20, 10)), cells=24),
    "open box": open_box,
    "terrain": hilly,
}


def points_around(surface: MeshSurface, dtype: torch.dtype) -> torch.Tensor:
    """Points in and around the box of a solid, some of them far away."""
    lower, upper = surface.bounds().double()
    generator = torch.Generator().manual_seed(0)
    parts = 3 * torch.rand(4000, 3, generator=generator, dtype=torch.float64) - 1
    return (lower + (upper - lower) * torch.cat([parts, 0.5 + 0.3 * (parts - 0.5), 9 * parts[:99]])).to(dtype)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("solid", SOLIDS)
def test_distance_and_normal_are_those_of_the_cpu(solid, dtype):
    surface = SOLIDS[solid]()
    points = points_around(surface, dtype)
    distance, normal = surface.query_on_device(points)
    expected, direction = map(torch.from_numpy, surface.query_points(points.double().numpy()))
    torch.testing.assert_close(distance.double(), expected, atol=1e-6, rtol=1e-6)
    assert distance.dtype == normal.dtype == dtype
    # Halfway between two sides either normal is right.
    assert (torch.linalg.vector_norm(normal.double() - direction, dim=1) > 1e-2).double().mean() < 2e-3


def test_on_the_surface_the_normal_is_that_of_face_edge_and_corner():
    surface = MeshSurface(trimesh.creation.box((2.0, 2.0, 2.0)), cells=16)
    points = torch.tensor([[0.3, 0.2, 1.0], [1.0, 0.2, 1.0], [1.0, 1.0, 1.0]], dtype=torch.float64)
    distance, normal = surface.query_on_device(points)
    torch.testing.assert_close(distance, torch.zeros(3, dtype=torch.float64), atol=1e-9, rtol=0)
    expected = torch.nn.functional.normalize(torch.tensor([[0.0, 0, 1], [1, 0, 1], [1, 1, 1]]).double(), dim=1)
    torch.testing.assert_close(normal, expected, atol=1e-6, rtol=0)


@pytest.mark.parametrize("solid", ["torus", "terrain"])
def test_a_point_that_is_not_finite_has_no_distance(solid):
    points = torch.tensor([[0.0, 0.0, torch.nan], [torch.inf, 0.0, 0.0], [0.0, 0.0, 0.5]])
    distance, normal = SOLIDS[solid]().query_on_device(points)
    assert distance.isnan().tolist() == [True, True, False] and normal.isnan().all(dim=1).tolist() == [
        True,
        True,
        False,
    ]


def test_a_copy_of_a_queried_solid_makes_its_own_query():
    surface = SOLIDS["torus"]()
    points = points_around(surface, torch.float32)
    expected, _ = surface.query_on_device(points)
    assert torch.equal(deepcopy(surface).query_on_device(points)[0], expected)


@pytest.mark.parametrize("architecture", [80, 90])
def test_the_kernels_compile_for_gpus(architecture, tmp_path):
    assert_compile([mesh_kernels], architecture, torch.float64, tmp_path)
