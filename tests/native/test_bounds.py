"""Arrays of Python index memory in C++: what would lead beyond it is refused."""

import numpy as np
import pytest

from surfsup import native
from surfsup.native.dispatch import is_built

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")

CUBE = np.float32([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
TABLE = np.concatenate([CUBE.sum(axis=1, keepdims=True), np.ones((8, 3), np.float32)], axis=1)


def grid(table=TABLE, cell=1.0, nodes=(2, 2, 2), lower=(0.0, 0.0, 0.0)):
    return (table, lower, (0.0, 0.0, 0.0), cell, nodes)


def values_at(points, grid):
    distance, gradient = np.empty(len(points)), np.empty((len(points), 3))
    native.interpolate_grid(grid, points, distance, gradient, 1)
    return distance, gradient


def test_a_grid_is_read_at_no_point_beyond_its_nodes():
    away = [-1e300, -1e30, -1e9, -1.0, 0.5, 2.0, 1e9, 1e30, 1e300, np.nan, np.inf, -np.inf]
    points = np.array([[x, y, 0.5] for x in away for y in away])
    distance, gradient = values_at(points, grid())
    inside = [np.flatnonzero((points == 0.5).all(axis=1))[0]]
    np.testing.assert_allclose(distance[inside], 1.5 + 0.5 * 1.5)
    np.testing.assert_allclose(gradient[inside], 1.0)


@pytest.mark.parametrize("nodes", [(2, 2, 3), (1, 2, 4), (-2, -2, 2), (2**32, 2**32, 2**32), (2**62, 2, 2), (0, 2, 2)])
def test_a_grid_has_a_row_per_node(nodes):
    with pytest.raises(ValueError, match="one row per node"):
        values_at(np.zeros((1, 3)), grid(nodes=nodes))


@pytest.mark.parametrize("cell", [0.0, -1.0, np.nan])
def test_the_cells_of_a_grid_have_a_size(cell):
    with pytest.raises(ValueError, match="must have a size"):
        values_at(np.zeros((1, 3)), grid(cell=cell))


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
def test_a_mesh_has_finite_vertices(value):
    vertices = np.random.default_rng(0).random((300, 3))
    vertices[7, 1] = value
    with pytest.raises(IndexError, match="not finite, or too far away"):
        native.TriangleBvh(vertices, np.arange(300).reshape(-1, 3))


@pytest.mark.parametrize("face", [-1, 300, 2**62])
def test_a_face_has_vertices(face):
    faces = np.arange(300).reshape(-1, 3)
    faces[3, 2] = face
    with pytest.raises(IndexError, match="invalid vertex index"):
        native.TriangleBvh(np.random.default_rng(0).random((300, 3)), faces)


def test_solids_nested_by_the_thousand_are_refused_before_the_stack_ends():
    solid = native.Solid("sphere", [1.0], [])
    with pytest.raises(ValueError, match="nested too deeply"):
        for _ in range(2000):
            solid = native.Solid("complement", [], [solid])


@pytest.mark.parametrize(
    ("resolution", "indices", "stored"),
    [
        ((-1, -1, 2), 2, 2),
        ((2, 2, 2), 8, 0),
        ((2, 2, 2), 7, 2),
        ((2**31 - 1, 2**31 - 1, 8), 8, 2),
        ((2**25, 1, 1), 8, 2),
    ],
)
def test_a_boundary_map_has_the_cells_that_it_says(resolution, indices, stored):
    with pytest.raises(ValueError, match="cell"):
        boundary_map(resolution, np.zeros(indices, np.int32), stored)


def test_a_boundary_map_stores_the_cells_that_it_names():
    boundary_map((2, 2, 2), np.full(8, 0, np.int32), 2)
    with pytest.raises(ValueError, match="exceeds the number of stored cells"):
        boundary_map((2, 2, 2), np.full(8, 1, np.int32), 2)


def boundary_map(resolution, cell_indices, stored):
    size = np.ones(3, np.float32)
    return native.BoundaryMap(size, size, np.int32(resolution), cell_indices, np.zeros((stored, 2, 32), np.float32))


@pytest.mark.parametrize(
    ("starts", "senders"),
    [
        ([0, 1, 2], [1, 2]),  # no such particle
        ([0, 1, 2], [-1, 0]),
        ([0, 1, 3], [1, 0]),  # beyond the edges
        ([0, 3, 2], [1, 0]),
        ([1, 1, 2], [1, 0]),
        ([0, -5, 2], [1, 0]),
        ([], []),
    ],
)
def test_a_neighbor_list_names_particles(starts, senders):
    starts, senders = np.array(starts, np.int64), np.array(senders, np.int64)
    kernels, values = np.zeros((len(senders), 4), np.float32), np.zeros((2, 4), np.float32)
    with pytest.raises(ValueError, match="starts must"):
        native.sum_kernels(starts, senders, kernels, values, np.zeros((2, 4, 4), np.float32), 1)
    with pytest.raises(ValueError, match="starts must"):
        weights = np.zeros((64, 16), np.float32), np.zeros((16, 16), np.float32)
        hidden = np.zeros((2, 16), np.float32)
        native.convolve(starts, senders, kernels, hidden, *weights, np.zeros_like(hidden), 1)
