import pytest
import torch

from surfsup.sdf import Box, Difference, Intersection, MeshSurface, Sphere, Transformed, Union
from surfsup.sdf.true_distance import TrueDistance, is_bound

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
