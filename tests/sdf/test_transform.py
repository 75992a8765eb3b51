"""Scale, then rotate, then move: distances stay exact."""

import math

import numpy as np
import pytest
import torch
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.sdf import Box, CappedCone, MeshSurface, Sphere, Transformed, Union, axis_rotation
from tests.sdf.solids import points_around

axis = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: sum(x * x for x in v) > 0.01)
degrees = st.floats(-720, 720)
offset = st.tuples(*[st.floats(-2, 2)] * 3)
SOLID = CappedCone(0.5, 0.3, 0.1)
POINTS = points_around(SOLID, count=200)


def rotation_about(axis, degrees):
    return axis_rotation(torch.tensor(axis, dtype=torch.float64), degrees)


@given(axis, degrees)
def test_a_rotation_is_orthonormal_and_right_handed(axis, degrees):
    matrix = rotation_about(axis, degrees)
    torch.testing.assert_close(matrix @ matrix.T, torch.eye(3, dtype=torch.float64))
    assert float(torch.linalg.det(matrix)) == pytest.approx(1)
    direction = torch.tensor(axis, dtype=torch.float64)
    torch.testing.assert_close(matrix @ direction, direction)


def test_a_quarter_turn_about_z_takes_x_to_y():
    x = torch.tensor([1.0, 0.0, 0.0])
    torch.testing.assert_close(axis_rotation((0, 0, 2), 90) @ x, torch.tensor([0.0, 1.0, 0.0]))


@given(axis, degrees)
def test_the_opposite_rotation_is_the_inverse(axis, degrees):
    torch.testing.assert_close(
        rotation_about(axis, degrees) @ rotation_about(axis, -degrees), torch.eye(3, dtype=torch.float64)
    )


@given(axis, degrees, offset, st.floats(0.1, 10))
def test_points_that_are_transformed_along_have_the_scaled_distance(axis, degrees, offset, scale):
    rotation = rotation_about(axis, degrees)
    shift, size = torch.tensor(offset, dtype=torch.float64), torch.tensor(scale, dtype=torch.float64)
    moved = Transformed(SOLID, rotation, shift, size)
    world = scale * POINTS @ rotation.T + shift
    torch.testing.assert_close(moved.to_own_frame(world), POINTS, atol=1e-9, rtol=0)
    distance, normal = moved.distance_and_normal(world)
    own_distance, own_normal = SOLID.distance_and_normal(POINTS)
    torch.testing.assert_close(distance, scale * own_distance, atol=1e-9, rtol=0)
    torch.testing.assert_close(distance, moved.distance(world))
    torch.testing.assert_close(normal, own_normal @ rotation.T, atol=1e-6, rtol=0)


@given(st.floats(0.1, 10))
def test_distances_scale_with_the_surface(scale):
    scaled = Transformed(SOLID, scale=torch.tensor(scale, dtype=torch.float64))
    torch.testing.assert_close(scaled.distance(POINTS), scale * SOLID.distance(POINTS / scale))


@given(axis, degrees, offset, st.floats(0.2, 3))
def test_bounds_contain_the_solid(axis, degrees, offset, scale):
    moved = Transformed(SOLID, rotation_about(axis, degrees), offset, scale)
    lower, upper = moved.bounds()
    query = scale * POINTS @ rotation_about(axis, degrees).T + torch.tensor(offset, dtype=torch.float64)
    within = query[moved.distance(query) < 0]
    assert len(within)
    assert ((within >= lower - 1e-5) & (within <= upper + 1e-5)).all()


def test_gradients_reach_axis_angle_translation_scale_and_shape():
    values = ((0.3, -0.5, 1.0), 40.0, (0.1, 0.2, -0.1), 1.3, (0.4, 0.5, 0.6))
    inputs = [torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in values]
    query = points_around(Sphere(0.6), count=20, seed=4).requires_grad_()

    def distance_and_normal(query, axis, degrees, translation, scale, size):
        surface = Transformed(Box(size), axis_rotation(axis, degrees), translation, scale)
        return surface.distance_and_normal(query)

    assert torch.autograd.gradcheck(distance_and_normal, (query, *inputs), eps=1e-7, atol=1e-5)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("parameter", [torch.float32, torch.float64])
def test_precisions_mix_and_results_have_the_precision_of_the_points(dtype, parameter):
    size = torch.tensor([0.4, 0.5, 0.6], dtype=parameter)
    cone = CappedCone(size[0], size[1], size[2])
    for inner in (Box(size), cone, Union(Box((0.3, 0.3, 0.3)), Sphere(size[0]))):
        surface = Transformed(inner, axis_rotation((0, 1, 0), 30), size, size[0])
        distance, normal = surface.distance_and_normal(POINTS.to(dtype))
        assert distance.dtype == normal.dtype == dtype
        assert torch.isfinite(surface.bounds()).all()


def test_a_mirror_image_keeps_distances():
    mirror = torch.diag(torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64))
    distance, normal = Transformed(SOLID, mirror).distance_and_normal(POINTS @ mirror)
    own_distance, own_normal = SOLID.distance_and_normal(POINTS)
    torch.testing.assert_close(distance, own_distance)
    torch.testing.assert_close(normal, own_normal @ mirror)


def test_results_require_gradients_only_if_an_input_does():
    query = torch.rand(5, 3)
    assert not any(result.requires_grad for result in Transformed(SOLID).distance_and_normal(query))
    grown = Transformed(SOLID, scale=torch.tensor(1.0, requires_grad=True))
    assert all(result.requires_grad for result in Transformed(grown).distance_and_normal(query))
    with torch.no_grad():
        assert not any(result.requires_grad for result in grown.distance_and_normal(query))


def test_module_methods_reach_every_part():
    surface = Transformed(Union(Sphere(0.3), SOLID)).double()
    assert {buffer.dtype for buffer in surface.buffers()} == {torch.float64}


@pytest.mark.parametrize("wrong", [(0, 0, 0), (math.nan, 0, 1), (math.inf, 0, 0), (1, 0)])
def test_an_axis_without_a_direction_is_refused(wrong):
    with pytest.raises(InputError, match="rotate: axis"):
        axis_rotation(wrong, 30)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"rotation": 2 * torch.eye(3)}, "rotation"),
        ({"rotation": torch.eye(4)}, "rotation"),
        ({"translation": (0.0, math.nan, 0.0)}, "translation"),
        ({"translation": (0.0, 1.0)}, "translation"),
        ({"scale": 0.0}, "scale"),
        ({"scale": -1.0}, "scale"),
    ],
)
def test_transformations_that_change_distances_are_refused(arguments, named):
    with pytest.raises(InputError, match=named):
        Transformed(Sphere(0.3), **arguments)


def test_a_transformed_mesh_keeps_its_triangles_and_a_mirrored_one_its_orientation():
    tube = trimesh.creation.cylinder(0.2, 0.5)
    mirror = torch.diag(torch.tensor([-1.0, 1.0, 1.0]))
    solid = Transformed(MeshSurface(tube), mirror, (0.1, 0.0, 0.3), scale=0.5)
    mesh = solid.to_mesh()
    assert len(mesh.faces) == len(tube.faces)
    assert mesh.volume == pytest.approx(tube.volume / 8)
    np.testing.assert_allclose(mesh.bounds, solid.bounds().numpy(), atol=1e-6)
