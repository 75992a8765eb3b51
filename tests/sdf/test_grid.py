"""Distances on a grid: third-order interpolation inside, an upper bound beyond, the same natively as in torch."""

import copy
import pickle

import numpy as np
import pytest
import torch

from surfsup import native
from surfsup.sdf import Torus
from surfsup.sdf.grid import SdfGrid
from surfsup.sdf.mesh.grid_distances import mesh_distances, mesh_grid
from surfsup.sdf.mesh.query import MeshQuery
from tests.sdf.solids import fine_mesh, sphere_grid

TORUS = fine_mesh(Torus, {"major_radius": 0.3, "minor_radius": 0.12})


@pytest.fixture(scope="module")
def query():
    return MeshQuery(np.asarray(TORUS.vertices), np.asarray(TORUS.faces))


@pytest.fixture(scope="module")
def torus_grid(query):
    return mesh_grid(query, 0.04, margin=0.1)


def points_in(grid, count=2000):
    random = torch.rand(count, 3, generator=torch.Generator().manual_seed(3), dtype=grid.lower.dtype)
    points = grid.lower + random * (grid.upper - grid.lower)
    points[:2] = torch.stack([grid.lower, grid.upper])
    return points


def test_a_grid_has_the_distance_between_its_nodes_and_beyond_them():
    grid = sphere_grid()
    points = 2.2 * torch.rand(400, 3, generator=torch.Generator().manual_seed(1)) - 1.1
    points = points[torch.linalg.vector_norm(points, dim=-1) > 0.3]
    distance, gradient = grid.sample(points)
    radius = torch.linalg.vector_norm(points, dim=-1)
    torch.testing.assert_close(distance, radius - 0.8, atol=4e-3, rtol=0)
    cosine = torch.nn.functional.cosine_similarity(gradient, points)
    assert float(cosine.min()) > 0.99
    far = torch.tensor([[3.0, 0, 0], [0, -5, 0.1], [2.0, 2.0, 2.0]])
    distance, gradient = grid.sample(far)
    torch.testing.assert_close(distance, torch.linalg.vector_norm(far, dim=-1) - 0.8, atol=0.02, rtol=0)
    torch.testing.assert_close(torch.nn.functional.cosine_similarity(gradient, far), torch.ones(3), atol=1e-3, rtol=0)


def test_at_its_nodes_a_grid_has_the_given_distances(torus_grid):
    for grid in (sphere_grid(), torus_grid):
        distance, _ = grid.sample(grid.nodes())
        torch.testing.assert_close(distance.reshape(grid.shape), grid.node_distance, atol=1e-6, rtol=0)


def test_halving_the_cell_divides_the_error_by_about_eight():
    points = torch.tensor([[0.93, 0.11, 0.08], [0.41, -0.83, 0.32], [-0.2, 0.3, 0.96]])
    exact = torch.linalg.vector_norm(points, dim=-1) - 0.8
    coarse, fine = ((sphere_grid(cell).sample(points)[0] - exact).abs().mean() for cell in (0.2, 0.05))
    assert fine < coarse / 16


def test_distances_are_differentiable_in_the_points_inside_and_beyond_the_grid():
    grid = SdfGrid(*(value.double() for value in (sphere_grid().node_distance, normals(), sphere_grid().lower)), 0.1)
    points = torch.tensor([[0.83, 0.11, 0.08], [0.52, -0.73, 0.32], [2.5, 0.3, 0.2]], dtype=torch.float64)
    points.requires_grad_()
    # The table is in single precision, the interpolation in that of the points.
    assert torch.autograd.gradcheck(lambda x: grid.sample(x)[0], points, eps=1e-3, atol=5e-3)


def normals():
    return torch.nn.functional.normalize(sphere_grid().nodes(), dim=-1).reshape(*sphere_grid().shape, 3)


def test_the_nearest_node_and_its_distance(torus_grid):
    points = points_in(torus_grid, 200)
    to_node, index = (torch.from_numpy(value) for value in torus_grid.nearest_node(points.numpy()))
    every = torch.cdist(points, torus_grid.nodes())
    torch.testing.assert_close(to_node, every.amin(dim=1))
    torch.testing.assert_close(every[torch.arange(200), index], every.amin(dim=1))


def test_the_distances_around_a_mesh_are_exact_and_reach_beyond_it(query, torus_grid):
    distance, gradient, lower = mesh_distances(query, 0.04, margin=0.1)
    assert torch.equal(torus_grid.node_distance, distance)
    nodes = torus_grid.nodes()
    torch.testing.assert_close(distance.flatten(), Torus(0.3, 0.12).distance(nodes), atol=1e-3, rtol=0)
    torch.testing.assert_close(gradient.norm(dim=-1), torch.ones_like(distance))
    assert torch.equal(lower, torch.from_numpy(query.vertices.min(axis=0) - 0.1))
    assert (torus_grid.upper >= torch.from_numpy(query.vertices.max(axis=0) + 0.1)).all()


@pytest.mark.skipif(not native.instruction_sets(), reason="the package was built without a compiler")
def test_native_interpolation_is_that_of_numpy(torus_grid, monkeypatch):
    points = points_in(torus_grid).numpy()
    distance, gradient = torus_grid.interpolate(points)
    monkeypatch.setattr(native, "instruction_sets", list)
    expected, expected_gradient = torus_grid.interpolate(points)
    np.testing.assert_allclose(distance, expected, atol=1e-6)
    np.testing.assert_allclose(gradient, expected_gradient, atol=2e-6)


def test_interpolation_in_numpy_is_that_of_torch(torus_grid):
    points = points_in(torus_grid)
    distance, gradient = torus_grid.interpolate(points.numpy())
    expected, expected_gradient = torus_grid.sample(points)
    np.testing.assert_allclose(distance, expected.numpy(), atol=1e-6)
    np.testing.assert_allclose(gradient, expected_gradient.numpy(), atol=2e-6)


def test_a_copy_gives_the_same_distances(torus_grid):
    points = points_in(torus_grid, 50)
    for other in (copy.deepcopy(torus_grid), pickle.loads(pickle.dumps(torus_grid))):
        assert torch.equal(other.sample(points)[0], torus_grid.sample(points)[0])
