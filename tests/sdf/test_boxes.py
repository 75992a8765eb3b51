"""Boxes give the distances of a union of boxes."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.sdf import Box, Boxes, Transformed, Union, axis_rotation
from tests.sdf.solids import points_around


def some_boxes(count, seed=0):
    generator = torch.Generator().manual_seed(seed)
    size, center, axis = (torch.rand(count, 3, generator=generator, dtype=torch.float64) for _ in range(3))
    rotations = [axis_rotation(axis[k] + 0.1, 90.0 * k) for k in range(count)]
    return 0.1 + 0.3 * size, torch.stack(rotations), center - 0.5


def as_union(size, rotation, center):
    return Union(*(Transformed(Box(s), r, c) for s, r, c in zip(size, rotation, center, strict=True)))


@given(count=st.integers(1, 12), seed=st.integers(0, 1000))
def test_distance_normal_and_bounds_are_those_of_the_union(count, seed):
    parts = some_boxes(count, seed)
    boxes, union = Boxes(*parts), as_union(*parts)
    points = points_around(boxes, count=300, seed=seed)
    torch.testing.assert_close(boxes.distance(points), union.distance(points))
    distance, normal = boxes.distance_and_normal(points)
    torch.testing.assert_close(distance, union.distance(points))
    torch.testing.assert_close(normal, union.distance_and_normal(points)[1], atol=1e-6, rtol=0)
    torch.testing.assert_close(boxes.bounds(), union.bounds())


def test_gradients_in_points_and_parameters_are_those_of_finite_differences():
    size, rotation, center = some_boxes(5)
    points = points_around(Boxes(size, rotation, center), count=40).requires_grad_()

    def distance(points, size, center):
        return Boxes(size, rotation, center).distance(points)

    assert torch.autograd.gradcheck(distance, (points, size.requires_grad_(), center.requires_grad_()), atol=1e-6)


def test_single_precision_agrees_with_double():
    boxes = Boxes(*some_boxes(20))
    points = points_around(boxes)
    single = boxes.distance(points.float())
    assert single.dtype == torch.float32
    torch.testing.assert_close(single.double(), boxes.distance(points), atol=1e-6, rtol=0)


def test_normals_point_out_of_the_nearest_box():
    boxes = Boxes(
        torch.tensor([[0.2, 0.2, 0.2]] * 2), torch.eye(3).repeat(2, 1, 1), torch.tensor([[0.0] * 3, [1.0, 0, 0]])
    )
    distance, normal = boxes.distance_and_normal(torch.tensor([[0.3, 0.0, 0.0], [0.7, 0.0, 0.0], [1.0, 0.05, 0.0]]))
    torch.testing.assert_close(distance, torch.tensor([0.2, 0.2, -0.05]))
    torch.testing.assert_close(normal, torch.tensor([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]]))


@pytest.mark.parametrize(
    ("size", "center", "message"),
    [(torch.zeros(0, 3), torch.zeros(0, 3), "must be"), (torch.ones(2, 3), torch.zeros(1, 3), "must be"),
     (torch.tensor([[1.0, 0.0, 1.0]]), torch.zeros(1, 3), "positive")],
)  # fmt: skip
def test_parameters_that_do_not_match_are_refused(size, center, message):
    with pytest.raises(InputError, match=message):
        Boxes(size, torch.eye(3).repeat(len(size), 1, 1), center)
