"""Each primitive is the exact signed distance to the solid that it is named after."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.sdf import Box, CappedCone, Cylinder, MeshSurface, Sphere, Torus
from tests.sdf.solids import SHAPES, fine_mesh, points_around


def doubles(parameters):
    return {name: torch.tensor(value, dtype=torch.float64) for name, value in parameters.items()}


def test_distance_is_that_of_a_fine_mesh_of_the_solid(shape):
    kind, parameters = shape
    surface = kind(**parameters)
    points = points_around(surface)
    true = MeshSurface(fine_mesh(kind, parameters), exact=True).distance(points)
    torch.testing.assert_close(surface.distance(points), true, atol=2e-4, rtol=0)


def test_normal_is_that_of_a_fine_mesh_of_the_solid(shape):
    kind, parameters = shape
    surface = kind(**parameters)
    points = points_around(surface)
    distance, normal = surface.distance_and_normal(points)
    _, true = MeshSurface(fine_mesh(kind, parameters), exact=True).distance_and_normal(points)
    clear = distance > 0.02  # inside, the medial axis is near everywhere
    cosine = (normal * true).sum(dim=1)[clear]
    assert cosine.mean() > 0.9999
    assert (cosine > 0.99).double().mean() > 0.995  # the axis of the torus is a medial axis outside it


def test_gradient_has_unit_length_away_from_the_medial_axis(shape):
    kind, parameters = shape
    surface = kind(**doubles(parameters))
    points = points_around(surface).requires_grad_()
    (gradient,) = torch.autograd.grad(surface.distance(points).sum(), points)
    length = gradient.norm(dim=1)
    assert (length - 1).abs().max() < 1e-9  # random points never hit the axis itself


def test_bounds_are_the_tightest_box(shape):
    kind, parameters = shape
    corners = fine_mesh(kind, parameters).bounds
    np.testing.assert_allclose(kind(**parameters).bounds().numpy(), corners, atol=1e-3)


def test_single_precision_agrees_with_double(shape):
    kind, parameters = shape
    surface = kind(**parameters)
    points = points_around(surface)
    single = surface.distance(points.float())
    assert single.dtype == torch.float32
    torch.testing.assert_close(single.double(), surface.distance(points), atol=1e-6, rtol=0)


def test_gradients_in_points_and_parameters_are_those_of_finite_differences(shape):
    kind, parameters = shape
    values = doubles(parameters)
    surface = kind(**values)
    assert all(getattr(surface, name).dtype == torch.float64 for name in values)
    inputs = [value.requires_grad_() for value in values.values()]
    points = points_around(surface, count=40, seed=3).requires_grad_()

    def distance(points, *arguments):
        return kind(*arguments).distance(points)

    assert torch.autograd.gradcheck(distance, (points, *inputs), eps=1e-7, atol=1e-6)


def test_normals_can_be_differentiated_too(shape):
    kind, parameters = shape
    surface = kind(**doubles(parameters))
    points = points_around(surface, count=20, seed=5).requires_grad_()
    assert torch.autograd.gradcheck(lambda p: surface.distance_and_normal(p)[1], (points,), eps=1e-7, atol=1e-5)


SPECIAL = [
    *[(x, y, z) for x in (0, 0.2) for y in (0, 0.2) for z in (-0.25, -0.1, 0, 0.25, 0.7)],
    (0.2, 0, 0),  # on the circle along which the thin tori are swept, on sides, at corners
    (0.4, 0, 0),
    (0.3, 0, 0.25),
    (0.15, 0, -0.25),
    (0.2, 0.275, 0.35),
]


def test_every_derivative_is_finite_at_special_points(shape):
    kind, parameters = shape
    values = {name: value.requires_grad_() for name, value in doubles(parameters).items()}
    points = torch.tensor(SPECIAL, dtype=torch.float64, requires_grad=True)
    distance, normal = kind(**values).distance_and_normal(points)
    assert torch.isfinite(distance).all()
    assert torch.isfinite(normal).all()
    inputs = (points, *values.values())
    first = torch.autograd.grad(distance.sum(), inputs, retain_graph=True)
    second = torch.autograd.grad((normal * torch.arange(1.0, 4.0)).sum(), inputs, allow_unused=True)
    for gradient in (*first, *second):
        assert gradient is None or torch.isfinite(gradient).all()


@pytest.mark.parametrize(
    ("surface", "point", "normal"),
    [
        (Sphere(0.3), (0.0, 0.3, 0.0), (0, 1, 0)),
        (Box((0.4, 0.5, 0.6)), (0.2, 0.1, 0.1), (1, 0, 0)),
        (Cylinder(0.25, 0.5), (0.1, 0.0, -0.25), (0, 0, -1)),
        (Cylinder(0.25, 0.5), (0.0, 0.25, 0.0), (0, 1, 0)),
        (CappedCone(0.5, 0.25, 0.125), (0.0, 0.0, 0.25), (0, 0, 1)),
        (CappedCone(0.5, 0.25, 0.125), (0.125, 0.0, -0.25), (0, 0, -1)),
        (CappedCone(0.5, 0.25, 0.125), (0.1875, 0.0, 0.0), (0.5, 0, 0.125)),
        (Torus(0.5, 0.125), (0.625, 0.0, 0.0), (1, 0, 0)),
    ],
)
def test_points_on_the_surface_have_a_normal(surface, point, normal):
    distance, found = surface.distance_and_normal(torch.tensor([point]))
    expected = torch.nn.functional.normalize(torch.tensor([normal], dtype=torch.float32))
    assert abs(float(distance)) < 1e-7
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=0)


@given(
    radius=st.floats(0.25, 0.5),
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: sum(x * x for x in v) > 0.01),
    meters=st.floats(-0.2, 2.0),
)
def test_a_sphere_is_its_radius_from_its_center(radius, direction, meters):
    unit = torch.nn.functional.normalize(torch.tensor([direction], dtype=torch.float64))
    distance, normal = Sphere(radius).distance_and_normal(unit * (radius + meters))
    assert float(distance) == pytest.approx(meters, abs=1e-6)
    torch.testing.assert_close(normal, unit)


@given(size=st.tuples(*[st.floats(0.4, 0.7)] * 3), beyond=st.tuples(*[st.floats(0, 1)] * 3))
def test_the_distance_of_points_beyond_a_corner_of_a_box_is_that_of_the_corner(size, beyond):
    point = torch.tensor([[side / 2 + more for side, more in zip(size, beyond, strict=True)]], dtype=torch.float64)
    assert float(Box(size).distance(point)) == pytest.approx(math.hypot(*beyond), abs=1e-6)


@pytest.mark.parametrize("wrong", [0, -0.3, math.nan, math.inf, (0.1, 0.2), "wide", None])
@pytest.mark.parametrize(("kind", "parameters"), [SHAPES[name] for name in SHAPES if "fat" in name or "box" in name])
def test_a_size_that_is_not_a_positive_number_is_refused_by_name(kind, parameters, wrong):
    for name in parameters:
        with pytest.raises(InputError, match=name) as error:
            kind(**{**parameters, name: wrong})
        assert "\n" not in str(error.value)
