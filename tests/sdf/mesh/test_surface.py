"""A mesh as a surface: exact near it, accurate far from it, right signs on damaged meshes."""

import copy
import pickle
import warnings

import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.sdf import Box, CappedCone, MeshSurface, Sphere, Torus, Transformed, Union, polygonize
from tests.sdf.solids import SHAPES, fine_mesh, points_around

TORUS = Torus(0.3, 0.12)
TORUS_MESH = fine_mesh(Torus, {"major_radius": 0.3, "minor_radius": 0.12})
CELL = 0.84 / 64


@pytest.fixture(scope="module")
def torus():
    return MeshSurface(TORUS_MESH)


@pytest.fixture(scope="module")
def exact_torus():
    return MeshSurface(TORUS_MESH, exact=True)


@pytest.mark.parametrize("name", ["box-uneven", "cone-fat", "torus-fat"])
def test_distance_normal_and_sign_are_those_of_the_analytic_solid(name):
    kind, parameters = SHAPES[name]
    analytic, surface = kind(**parameters), MeshSurface(fine_mesh(kind, parameters), cells=24)
    points = points_around(analytic, margin=0.15)
    distance, normal = surface.distance_and_normal(points)
    true, true_normal = analytic.distance_and_normal(points)
    assert (distance - true).abs().mean() < 3e-4
    assert (distance - true).abs().max() < 5e-3
    assert ((distance < 0) == (true < 0))[true.abs() > 2e-4].all()
    clear = true > 0.01
    assert (normal * true_normal).sum(dim=1)[clear].mean() > 0.999


def test_near_the_surface_the_grids_change_nothing(torus, exact_torus):
    near = TORUS_MESH.sample(2000, seed=1) + np.random.default_rng(1).normal(size=(2000, 3)) * CELL
    near = torch.as_tensor(near)
    distance, normal = torus.distance_and_normal(near)
    true, true_normal = exact_torus.distance_and_normal(near)
    clear = true.abs() < 2 * CELL
    assert clear.double().mean() > 0.9
    assert torch.equal(distance[clear], true[clear])
    assert torch.equal(normal[clear], true_normal[clear])


@pytest.mark.parametrize(("margin", "mean", "most"), [(0.1, 5e-5, 2e-3), (0.8, 5e-4, 1e-2)])
def test_far_from_the_surface_the_grids_are_close(torus, exact_torus, margin, mean, most):
    points = points_around(TORUS, margin=margin)
    off = (torus.distance(points) - exact_torus.distance(points)).abs()
    assert off.mean() < mean
    assert off.max() < most


def test_far_beyond_the_grids_the_distance_is_an_upper_bound_within_the_size_of_the_mesh(torus, exact_torus):
    points = torch.tensor([[20.0, 3.0, -5.0], [0.0, 0.0, 1e6], [-4.0, 0.1, 0.0]], dtype=torch.float64)
    over = torus.distance(points) - exact_torus.distance(points)
    rounding = 1e-7 * points.norm(dim=1)  # the nearest triangle is searched in single precision
    assert (over > -1e-3 - rounding).all()
    assert (over < 0.9).all()


def test_points_on_the_surface_have_the_normal_of_the_face_edge_or_vertex():
    cube = MeshSurface(trimesh.creation.box((0.5, 0.5, 0.5)))
    on = torch.tensor([[0.25, 0.1, 0.05], [0.25, 0.25, 0.1], [0.25, 0.25, 0.25]], dtype=torch.float64)
    expected = torch.nn.functional.normalize(torch.tensor([[1.0, 0, 0], [1, 1, 0], [1, 1, 1]]), dim=1).double()
    for surface in (cube, Box((0.5, 0.5, 0.5))):
        distance, normal = surface.distance_and_normal(on)
        assert distance.abs().max() < 1e-9
        torch.testing.assert_close(normal, expected, atol=1e-6, rtol=0)


def test_signs_are_right_with_one_triangle_in_twenty_missing():
    rng = np.random.default_rng(0)
    solid = polygonize(TORUS, 48)
    kept = rng.random(len(solid.faces)) > 0.05
    damaged = trimesh.Trimesh(solid.vertices, solid.faces[kept], process=False)
    points = points_around(TORUS, count=5000, margin=0.1)
    true = TORUS.distance(points)
    for exact in (False, True):
        distance = MeshSurface(damaged, exact=exact).distance(points)
        wrong = (distance < 0) != (true < 0)
        assert wrong.double().mean() < 2e-3
        assert (true[wrong].abs() < CELL).all()  # only beside the surface


def test_signs_are_right_with_one_face_in_fifty_flipped():
    rng = np.random.default_rng(0)
    solid = polygonize(TORUS, 48)
    faces = solid.faces.copy()
    flipped = rng.random(len(faces)) < 0.02
    faces[flipped] = faces[flipped][:, ::-1]
    points = points_around(TORUS, count=5000, margin=0.1)
    distance = MeshSurface(trimesh.Trimesh(solid.vertices, faces, process=False)).distance(points)
    true = TORUS.distance(points)
    assert (((distance < 0) != (true < 0))[true.abs() > CELL]).double().mean() < 1e-3


@pytest.mark.parametrize("exact", [True, False])
def test_the_gradient_in_the_points_is_that_of_finite_differences(exact):
    surface = MeshSurface(trimesh.creation.box((0.5, 0.4, 0.3)), exact=exact)
    beside = torch.tensor([[0.26, 0.05, 0.03], [0.1, 0.21, 0.02], [0.02, 0.03, 0.14]], dtype=torch.float64)
    assert torch.autograd.gradcheck(surface.distance, (beside.requires_grad_(),), eps=1e-6, atol=1e-6)


def test_the_gradient_is_the_normal_and_finite_everywhere(torus):
    points = torch.cat([points_around(TORUS, count=300), torch.zeros(1, 3), torch.as_tensor(TORUS_MESH.vertices[:9])])
    points.requires_grad_()
    distance, normal = torus.distance_and_normal(points)
    (gradient,) = torch.autograd.grad(distance.sum(), points)
    assert torch.equal(gradient, normal)
    assert torch.isfinite(normal).all()
    torch.testing.assert_close(normal.norm(dim=1), torch.ones(len(points), dtype=torch.float64))


def test_the_normal_is_treated_as_constant(torus):
    points = points_around(TORUS, count=5).requires_grad_()
    distance, normal = torus.distance_and_normal(points)
    assert distance.requires_grad
    assert not normal.requires_grad


def test_results_have_the_precision_of_the_points(torus):
    for dtype in (torch.float32, torch.float64):
        distance, normal = torus.distance_and_normal(points_around(TORUS, count=5, dtype=dtype))
        assert distance.dtype == normal.dtype == dtype


def test_the_triangles_are_queried_once_and_only_for_points_that_need_it(exact_torus):
    surface = MeshSurface(TORUS_MESH)
    surface.build_grids()
    queried = []
    nearest = surface.query.nearest
    surface.query.nearest = lambda points, *bounds: queried.append(len(points)) or nearest(points, *bounds)
    points = points_around(TORUS, count=1000, margin=1.0)
    surface.distance_and_normal(points)
    assert len(queried) == 1
    assert queried[0] < 300


def test_a_mesh_can_be_transformed_and_combined(torus):
    moved = Transformed(torus, translation=(0.0, 0.0, 0.5), scale=2.0)
    both = Union(moved, CappedCone(0.3, 0.2))
    points = points_around(both, count=500)
    true = Union(Transformed(TORUS, translation=(0, 0, 0.5), scale=2.0), CappedCone(0.3, 0.2)).distance(points)
    assert (both.distance(points) - true).abs().max() < 5e-3
    distance, normal = both.distance_and_normal(points.requires_grad_())
    assert torch.isfinite(distance).all()
    assert torch.isfinite(normal).all()


def test_bounds_are_those_of_the_triangles(torus):
    np.testing.assert_allclose(torus.bounds().numpy(), TORUS_MESH.bounds, atol=1e-6)


def test_marching_cubes_of_a_mesh_gives_the_mesh_again(torus):
    assert polygonize(torus, 32).volume == pytest.approx(TORUS_MESH.volume, rel=0.02)


@pytest.mark.parametrize("exact", [True, False])
def test_no_points_and_points_that_are_not_finite_have_results(exact):
    surface = MeshSurface(trimesh.creation.icosphere(subdivisions=2, radius=0.3), cells=16, exact=exact)
    assert surface.distance(torch.zeros(0, 3)).shape == (0,)
    distance, normal = surface.distance_and_normal(
        torch.tensor([[torch.nan, 0.0, 0.0], [0.0, 0.0, 1.0], [torch.inf, 0.0, 0.0]])
    )
    assert torch.isnan(distance).tolist() == [True, False, True]
    assert torch.isnan(normal).all(dim=1).tolist() == [True, False, True]
    assert float(distance[1]) == pytest.approx(0.7, abs=1e-2)


def test_a_copy_gives_the_same_distances(torus):
    points = points_around(TORUS, count=50)
    for other in (copy.deepcopy(torus), pickle.loads(pickle.dumps(torus))):
        assert torch.equal(other.distance(points), torus.distance(points))


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), dtype=int), "no triangles"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "finite"),
    ],
)
def test_meshes_without_a_solid_are_refused(vertices, faces, message):
    with warnings.catch_warnings(), pytest.raises(InputError, match=message):
        warnings.simplefilter("ignore")
        MeshSurface(trimesh.Trimesh(vertices, faces, process=False))


def test_a_small_mesh_far_from_the_origin_keeps_its_precision():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.01)
    ball.apply_translation([100.0, -50.0, 30.0])
    center = torch.tensor([100.0, -50.0, 30.0], dtype=torch.float64)
    points = points_around(Sphere(0.01), count=500, margin=0.005)
    off = MeshSurface(ball).distance(points + center) - Sphere(0.01).distance(points)
    assert off.abs().max() < 1e-4
