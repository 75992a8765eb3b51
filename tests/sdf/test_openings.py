"""A cut that reaches a little beyond a solid, or ends at it, leaves its opening open."""

import pytest
import torch

from surfsup.sdf import Box, Cylinder, Difference, Intersection, Sphere, Torus, Transformed, Union
from surfsup.sdf.edges import with_edges
from surfsup.sdf.openings import OpenCut, with_openings
from surfsup.sdf.true_distance import TrueDistance

REACH = 0.025
MOUTH = 0.1  # height of the cups' mouths


def cup(beyond: float, wall: float = 0.03) -> Difference:
    """A cup of radius 0.13 m whose cut ends ``beyond`` meters above its mouth."""
    depth = 2 * MOUTH - 0.03
    hollow = Cylinder(0.13 - wall, depth + beyond)
    return Difference(Cylinder(0.13, 2 * MOUTH), Transformed(hollow, translation=(0, 0, 0.015 + beyond / 2)))


def opened(beyond: float, wall: float = 0.03):
    return with_openings(with_edges(cup(beyond, wall)), REACH)


@pytest.mark.parametrize("beyond", [0.0, 0.0005, 0.01])
def test_nothing_is_near_the_middle_of_a_mouth(beyond):
    mouth = torch.tensor([[0.01, 0.02, MOUTH + height] for height in (-0.01, -0.001, 0.001, 0.01)])
    assert with_edges(cup(beyond)).distance(mouth).min() < REACH
    distance = opened(beyond).distance(mouth)
    rim = 0.1 - (0.01**2 + 0.02**2) ** 0.5
    assert ((distance > rim - 0.005) & (distance < rim + 0.001)).all()


def test_the_solid_and_what_is_near_it_stay_as_they_are():
    surface, edged = opened(0.01), with_edges(cup(0.01))
    points = 0.3 * (torch.rand(20000, 3, generator=torch.Generator().manual_seed(0)) - 0.5)
    distance, before = surface.distance(points), edged.distance(points)
    assert ((distance < 0) == (before < 0)).all()
    assert (distance >= before).all() and (distance > before).any()
    true = TrueDistance(cup(0.01)).distance(points)
    outside = distance > 0
    assert (distance[outside] <= true[outside] + 1.1 * surface.cell).all()
    assert surface.bounds().equal(edged.bounds())


def test_the_normal_in_a_mouth_points_away_from_the_rim():
    normal = opened(0.01).distance_and_normal(torch.tensor([[0.08, 0.0, MOUTH + 0.002]]))[1]
    assert normal[0, 0] < -0.9


def test_a_cut_that_ends_far_beyond_the_mouth_costs_nothing():
    edged = with_edges(cup(0.06))
    assert with_openings(edged, REACH) is edged


@pytest.mark.parametrize(
    "surface",
    [
        Difference(Sphere(0.3), Transformed(Sphere(0.2), translation=(0.25, 0, 0))),
        Difference(Sphere(0.3), Cylinder(0.1, 1.0)),
        Intersection(Sphere(0.3), Box((0.4, 0.4, 0.4))),
        Difference(Torus(0.3, 0.1), Transformed(Box((0.3, 0.3, 0.3)), translation=(0.3, 0, 0))),
    ],
    ids=["bitten ball", "pierced ball", "cut ball", "cut torus"],
)
def test_curved_edges_are_no_openings(surface):
    edged = with_edges(surface)
    assert with_openings(edged, REACH) is edged


def test_solids_without_cuts_and_parts_that_need_nothing_stay_the_same_objects():
    ball = Sphere(0.1)
    assert with_openings(ball, REACH) is ball
    whole = with_openings(Union(ball, Transformed(with_edges(cup(0.01)), translation=(1, 0, 0), scale=2.0)), REACH)
    assert whole.parts[0] is ball and isinstance(whole.parts[1].surface, OpenCut)
    assert whole.parts[1].surface.reach == pytest.approx(REACH / 2)


def test_a_wall_too_thin_for_the_triangles_keeps_its_bound():
    edged = with_edges(cup(0.01, wall=0.0003))
    assert with_openings(edged, REACH) is edged
