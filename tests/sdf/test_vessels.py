"""Bowl and funnel: exact outside, a bound inside the wall, differentiable in the two radii that design optimizes."""

import math

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.sdf import Bowl, Funnel, MeshSurface, polygonize
from tests.sdf.solids import points_around, revolved

# Starts and ends of the two design tasks of section 7 of the SURFSUP supplement, and shapes beyond them.
VESSELS = {
    "bowl-start": (Bowl, {"capture_radius": 0.07, "filter_radius": 0.05}),
    "bowl-end": (Bowl, {"capture_radius": 0.232, "filter_radius": 0.0}),
    "bowl-hole": (Bowl, {"capture_radius": 0.3, "filter_radius": 0.1, "wall": 0.06}),
    "funnel-start": (Funnel, {"capture_radius": 0.10, "filter_radius": 0.09}),
    "funnel-end": (Funnel, {"capture_radius": 0.221, "filter_radius": 0.0714}),
    "funnel-upside-down": (Funnel, {"capture_radius": 0.1, "filter_radius": 0.2, "height": 0.1, "spout": 0.05}),
}


@pytest.fixture(params=list(VESSELS))
def vessel(request):
    return VESSELS[request.param]


def doubles(parameters):
    return {name: torch.tensor(value, dtype=torch.float64) for name, value in parameters.items()}


def arc(center, radius, start, end, count=100):
    angle = np.radians(np.linspace(start, end, count))
    return np.column_stack([center + radius * np.cos(angle), radius * np.sin(angle)])


def outline(kind, parameters):
    """The solid's outline in the (radial, axial) half plane, counterclockwise, without the distance function."""
    capture, hole, wall = parameters["capture_radius"], parameters["filter_radius"], parameters.get("wall", 0.04)
    if kind is Bowl:
        outside = arc(0, capture + wall, -math.degrees(math.acos(hole / (capture + wall))), 0)
        rim = arc(capture + wall / 2, wall / 2, 0, 180)
        inside = arc(0, capture, 0, -math.degrees(math.acos(hole / capture)))
        corners = np.concatenate([outside, rim[1:-1], inside])
        return np.concatenate([corners, corners[:1]]) if hole else corners
    height, spout = parameters.get("height", 0.25), parameters.get("spout", 0.1)
    inner = np.array([[capture, 0], [hole, -height], [hole, -height - spout]])
    middle = inner + np.array([wall / 2, 0])
    fraction = np.linspace(0, 1, 2000)[:, None]
    line = np.concatenate([middle[i] + fraction * (middle[i + 1] - middle[i]) for i in (0, 1)])
    return np.concatenate([line + disc for disc in arc(0, wall / 2, 0, 360, 181)])


def true_distance(kind, parameters, points):
    """Unsigned distance (N,) to the outline, revolved."""
    if kind is Bowl:
        mesh = revolved(outline(kind, parameters))
        return MeshSurface(mesh, exact=True).distance(points).abs()
    from scipy.spatial import cKDTree

    radial = np.column_stack([points[:, :2].norm(dim=1), points[:, 2]])
    return torch.from_numpy(cKDTree(outline(kind, parameters)).query(radial)[0])


def test_distance_is_exact_outside_and_a_bound_inside(vessel):
    kind, parameters = vessel
    surface = kind(**parameters)
    points = points_around(surface, count=4000)
    distance, true = surface.distance(points), true_distance(kind, parameters, points)
    outside = distance > 0.001
    assert 500 < outside.sum() < 4000
    torch.testing.assert_close(distance[outside], true[outside], atol=4e-4, rtol=0)
    if kind is Bowl:  # the outline of the funnel passes through its inside
        assert (distance[~outside].abs() <= true[~outside] + 4e-4).all()


def test_distance_never_changes_faster_than_the_point_moves(vessel):
    kind, parameters = vessel
    surface = kind(**doubles(parameters))
    points = points_around(surface, count=4000, seed=1)
    for size in (1e-4, 0.01, 0.1):
        step = torch.randn(points.shape, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
        step = size * torch.nn.functional.normalize(step, dim=1)
        assert (surface.distance(points + step) - surface.distance(points)).abs().max() <= size + 1e-9


def test_the_gradient_has_unit_length(vessel):
    kind, parameters = vessel
    points = points_around(kind(**parameters)).requires_grad_()
    (gradient,) = torch.autograd.grad(kind(**doubles(parameters)).distance(points).sum(), points)
    assert (gradient.norm(dim=1) - 1).abs().max() < 1e-9


@pytest.mark.parametrize(("capture", "hole"), [(0.2, 0.05), (0.2, 0.0), (0.07, 0.05)])
def test_the_radii_of_a_bowl_are_those_of_its_openings(capture, hole):
    bowl = Bowl(capture, hole)
    mouth_rim, hole_rim = bowl.distance(torch.tensor([[capture, 0.0, 0.0], [hole, 0.0, -capture - 0.02]]))
    in_hole = bowl.distance(torch.tensor([[0.0, 0.0, -capture - 0.02]]))
    assert abs(float(mouth_rim)) < 1e-6
    assert float(in_hole) == pytest.approx(hole or -0.02, abs=1e-6)  # closed: in the middle of the wall
    assert hole == 0 or abs(float(hole_rim)) < 1e-6


@pytest.mark.parametrize(("capture", "hole"), [(0.221, 0.0714), (0.1, 0.09)])
def test_the_inner_radius_of_a_spout_is_the_filter_radius(capture, hole):
    funnel = Funnel(capture, hole)
    wall_of_spout, middle_of_spout = funnel.distance(torch.tensor([[0.0, hole, -0.32], [0.0, 0.0, -0.32]]))
    assert abs(float(wall_of_spout)) < 1e-6
    assert float(middle_of_spout) == pytest.approx(hole, abs=1e-6)
    bead = torch.tensor([[capture + 0.02, 0.0, 0.02], [capture + 0.04, 0.0, 0.0]])  # around the mouth
    torch.testing.assert_close(funnel.distance(bead), torch.zeros(2), atol=1e-6, rtol=0)


def test_bounds_are_the_tightest_box(vessel):
    kind, parameters = vessel
    surface = kind(**parameters)
    mesh = polygonize(surface, 120)
    assert mesh.is_watertight
    np.testing.assert_allclose(surface.bounds().numpy(), mesh.bounds, atol=2e-3)


def test_gradients_in_points_and_radii_are_those_of_finite_differences(vessel):
    kind, parameters = vessel
    values = doubles(parameters)
    optimized = [name for name in values if float(values[name])]  # a closed hole cannot be made smaller
    points = points_around(kind(**values), count=60, seed=3).requires_grad_()

    def distance(points, *arguments):
        return kind(**{**values, **dict(zip(optimized, arguments, strict=True))}).distance(points)

    inputs = [values[name].requires_grad_() for name in optimized]
    assert torch.autograd.gradcheck(distance, (points, *inputs), eps=1e-7, atol=1e-6)


def test_every_derivative_is_finite_at_special_points(vessel):
    kind, parameters = vessel
    values = {name: value.requires_grad_() for name, value in doubles(parameters).items()}
    capture, hole = parameters["capture_radius"], parameters["filter_radius"]
    positions = [(x, 0.0, z) for x in (0.0, hole, capture, capture + 0.02) for z in (0.0, -0.1, -capture, -0.25, 0.3)]
    points = torch.tensor(positions, dtype=torch.float64, requires_grad=True)
    distance, normal = kind(**values).distance_and_normal(points)
    inputs = (points, *values.values())
    first = torch.autograd.grad(distance.sum(), inputs, retain_graph=True)
    second = torch.autograd.grad((normal * torch.arange(1.0, 4.0)).sum(), inputs, allow_unused=True)
    for value in (distance, normal, *first, *second):
        assert value is None or torch.isfinite(value).all()


def test_water_in_the_hole_gives_a_gradient_in_its_radius():
    radius = torch.tensor(0.05, requires_grad=True)
    in_hole = torch.tensor([[0.03, 0.0, -0.22]])
    Bowl(0.2, radius).distance(in_hole).sum().backward()
    assert float(radius.grad) == pytest.approx(1)


def test_single_precision_agrees_with_double(vessel):
    kind, parameters = vessel
    for surface in (kind(**parameters), kind(**doubles(parameters))):
        points = points_around(surface)
        single = surface.distance(points.float())
        assert single.dtype == torch.float32
        torch.testing.assert_close(single.double(), surface.distance(points), atol=2e-6, rtol=0)


@pytest.mark.parametrize("wrong", [-0.01, math.nan, math.inf, (0.1, 0.2), "wide", None])
def test_invalid_sizes_are_refused_by_name(vessel, wrong):
    kind, parameters = vessel
    for name in parameters:
        with pytest.raises(InputError, match=name) as error:
            kind(**{**parameters, name: wrong})
        assert "\n" not in str(error.value)


def test_a_hole_as_wide_as_the_mouth_is_refused():
    with pytest.raises(InputError, match=r"filter_radius is 0.2 m, but must be smaller than the capture_radius of 0.2"):
        Bowl(0.2, 0.2)
