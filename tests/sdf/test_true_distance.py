import pytest
import torch

from surfsup.errors import InputError
from surfsup.sdf import Box, Cylinder, Difference, Intersection, MeshSurface, Sphere, Transformed, Union
from surfsup.sdf.true_distance import TrueDistance, is_bound, with_true_distances

# A plate with a square hole, and the same plate of four boxes, whose distance is exact outside.
PLATE = Difference(Box((0.8, 0.8, 0.06)), Box((0.15, 0.15, 0.3)))
SIDE = (0.8 - 0.15) / 2
FOUR = Union(
    *(Transformed(Box((SIDE, 0.8, 0.06)), translation=(sign * (SIDE + 0.15) / 2, 0, 0)) for sign in (-1, 1)),
    *(Transformed(Box((0.8, SIDE, 0.06)), translation=(0, sign * (SIDE + 0.15) / 2, 0)) for sign in (-1, 1)),
)


def test_beside_the_rim_of_a_hole_the_distance_is_that_to_the_rim():
    true = TrueDistance(PLATE)
    beside = torch.tensor([[0.075 - 0.02, 0.0, 0.03 + 0.015]])
    assert PLATE.distance(beside).item() == pytest.approx(0.02, abs=1e-6)
    assert true.distance(beside).item() == pytest.approx(0.025, abs=2.5e-3)
    points = torch.rand(2000, 3, generator=torch.Generator().manual_seed(0)) * 0.4 - 0.2
    outside = FOUR.distance(points) > 0
    torch.testing.assert_close(true.distance(points)[outside], FOUR.distance(points)[outside], atol=2.5e-3, rtol=0)


def test_the_side_is_that_of_the_solid_itself():
    points = torch.rand(2000, 3, generator=torch.Generator().manual_seed(1)) * 0.4 - 0.2
    assert torch.equal(TrueDistance(PLATE).distance(points) < 0, PLATE.distance(points) < 0)


def test_only_solids_with_parts_cut_off_are_bounds():
    assert is_bound(PLATE)
    assert is_bound(Union(Sphere(0.1), Transformed(Intersection(Sphere(0.1), Sphere(0.2)))))
    assert not is_bound(FOUR)
    assert not is_bound(MeshSurface(Sphere(0.1).to_mesh(8)))


# A cup with walls of 6 mm, and a ground of 3 m that is cut, too.
CUP = Transformed(Difference(Cylinder(0.05, 0.1), Transformed(Cylinder(0.044, 0.2), translation=(0, 0, 0.106))))
GROUND = Difference(Box((3.0, 3.0, 0.1)), Transformed(Box((0.2, 0.2, 0.2)), translation=(1, 1, 0)))


def test_a_thin_cup_beside_a_large_ground_has_the_distance_of_the_cup_alone():
    cup = Transformed(CUP, translation=(0.0, 0.0, 1.0))
    whole = with_true_distances(Transformed(Union(GROUND, cup), translation=(0.5, 0.0, 1.0), scale=2.0))
    points = torch.rand(2000, 3, generator=torch.Generator().manual_seed(2)) * 0.14 + torch.tensor([-0.07, -0.07, 0.93])
    alone = TrueDistance(cup).distance(points)
    assert (alone < 0).any()
    world = 2 * points + torch.tensor([0.5, 0.0, 1.0])
    torch.testing.assert_close(whole.distance(world), 2 * alone, atol=1e-5, rtol=0)


def test_parts_whose_value_is_the_distance_stay_as_they_are():
    ball = Sphere(0.1)
    assert with_true_distances(Union(ball, FOUR)).parts[0] is ball
    whole = with_true_distances(Union(ball, PLATE))
    assert whole.parts[0] is ball
    assert isinstance(whole.parts[1], TrueDistance)
    assert isinstance(with_true_distances(Transformed(PLATE)), TrueDistance)


def test_an_empty_part_of_a_union_does_not_take_the_others_with_it():
    empty = Intersection(Sphere(0.1), Transformed(Sphere(0.1), translation=(1.0, 0.0, 0.0)))
    points = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 0.3]])
    whole = with_true_distances(Union(PLATE, empty))
    assert (whole.distance(points) > 0).all()
    assert whole.distance(torch.tensor([[0.3, 0.0, 0.0]])) < 0
    with pytest.raises(InputError, match="empty"):
        with_true_distances(empty)
