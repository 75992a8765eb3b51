"""Beside the edges of intersections and differences the distance is that to the edge."""

import math

import pytest
import torch

from surfsup import native
from surfsup.sdf import Box, Cylinder, Difference, Intersection, Sphere, Transformed, Union, axis_rotation
from surfsup.sdf.edges import EdgedIntersection, with_edges
from surfsup.sdf.true_distance import TrueDistance
from tests.sdf.solids import points_around
from tests.sdf.test_true_distance import FOUR, PLATE

# A plate with a round hole, turned, and a ball with a bite.
ROUND = Transformed(
    Difference(Box((0.8, 0.8, 0.06)), Cylinder(0.1, 0.3)), axis_rotation((1.0, 2.0, 0.5), 35.0), (0.1, 0.0, 0.2)
)
BITTEN = Difference(Sphere(0.3), Transformed(Sphere(0.2), translation=(0.0, 0.0, 0.3)))
BRANCHED = Union(Difference(Union(Sphere(0.3), Box((0.7, 0.2, 0.2))), Union(Cylinder(0.1, 1.0), Sphere(0.15))), ROUND)
SOLIDS = {"plate": PLATE, "round hole": ROUND, "bitten ball": BITTEN, "branched": BRANCHED}


def test_the_distance_to_a_plate_with_a_square_hole_is_that_to_the_same_plate_of_four_boxes():
    points = points_around(PLATE, count=4000)
    distance, normal = with_edges(PLATE).distance_and_normal(points)
    exact, exact_normal = FOUR.distance_and_normal(points)
    outside = (exact > 1e-3) & (exact < 0.06)
    assert (PLATE.distance(points)[outside] < exact[outside] - 0.005).any()
    torch.testing.assert_close(distance[outside], exact[outside], atol=1e-6, rtol=0)
    # Halfway between two sides the nearest point is not unique.
    same = (normal * exact_normal).sum(dim=-1)[outside] > 1 - 1e-4
    assert same.float().mean() > 0.99


def test_above_the_rim_of_a_round_hole_the_distance_is_that_to_the_rim():
    for inward, up in ((0.01, 0.02), (0.015, 0.003), (0.04, 0.04)):
        own = torch.tensor([[(0.1 - inward) * math.cos(1.0), (0.1 - inward) * math.sin(1.0), 0.03 + up]])
        point = own @ ROUND.rotation.T + ROUND.translation
        assert with_edges(ROUND).distance(point).item() == pytest.approx(math.hypot(inward, up), abs=1e-6)


@pytest.mark.parametrize("name", SOLIDS)
def test_within_the_clearance_of_particles_it_is_the_true_distance(name):
    surface = SOLIDS[name]
    points = points_around(surface, count=20000, dtype=torch.float32)
    true, distance, bound = (solid.distance(points) for solid in (TrueDistance(surface), with_edges(surface), surface))
    near = (true > 0) & (true < 0.03)
    assert (distance - true)[near].abs().max() < 3e-3  # triangles cut the edges off by that
    assert (true - bound)[near].max() > 2.5e-3


@pytest.mark.parametrize("name", SOLIDS)
def test_the_value_is_between_the_bound_and_twice_the_bound_and_has_its_sign(name):
    points = points_around(SOLIDS[name], count=4000)
    distance, bound = with_edges(SOLIDS[name]).distance(points), SOLIDS[name].distance(points)
    assert torch.equal(distance < 0, bound < 0)
    assert (distance >= bound - 1e-6).all()
    assert (distance <= 2 * bound.clamp(min=0) + 1e-6).all()
    inside = bound < 0
    torch.testing.assert_close(distance[inside], bound[inside], atol=1e-6, rtol=0)


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.skipif(not native.instruction_sets(), reason="there is no native code")
def test_native_code_gives_the_values_of_torch(name):
    surface = with_edges(SOLIDS[name])
    points = points_around(SOLIDS[name], count=4000, dtype=torch.float32)
    distance, normal = surface.distance_and_normal(points)
    expected, expected_normal = surface.distance_and_normal(points.double())
    torch.testing.assert_close(distance, expected.float(), atol=2e-6, rtol=0)
    torch.testing.assert_close(distance, surface.distance(points), atol=5e-7, rtol=0)
    # Where two parts are equally far, rounding decides.
    assert ((normal - expected_normal.float()).abs().amax(dim=-1) < 2e-3).float().mean() > 0.99


def test_the_normal_is_the_gradient_and_gradients_reach_the_parts():
    radius = torch.tensor(0.2, dtype=torch.float64, requires_grad=True)
    points = points_around(BITTEN, count=200).double()
    points = points[BITTEN.distance(points.float()) > 1e-3].requires_grad_()

    def distance(points, radius):
        bite = Transformed(Sphere(radius), translation=(0.0, 0.0, 0.3))
        return with_edges(Difference(Sphere(0.3), bite)).distance(points)

    assert torch.autograd.gradcheck(distance, (points, radius), eps=1e-7, atol=1e-5)


def test_solids_without_cuts_stay_the_same_objects():
    ball = Sphere(0.1)
    assert with_edges(ball) is ball
    assert with_edges(FOUR) is FOUR
    whole = with_edges(Union(ball, PLATE))
    assert whole.parts[0] is ball
    assert isinstance(whole.parts[1], EdgedIntersection)
    nested = with_edges(Difference(Intersection(ball, Box((1.0, 1.0, 1.0))), Union(Sphere(0.05), Cylinder(0.1, 0.1))))
    assert len(nested.parts) == 4
