"""Set operations: the sign is exact, the absolute distance never too large."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.sdf import Box, Difference, Intersection, MeshSurface, Sphere, Torus, Transformed, Union, polygonize
from tests.sdf.solids import points_around

place = st.tuples(*[st.floats(-0.3, 0.3)] * 3)
solid = st.one_of(
    st.builds(Sphere, st.floats(0.25, 0.5)),
    st.builds(Box, st.tuples(*[st.floats(0.4, 0.7)] * 3)),
    st.builds(Torus, st.floats(0.3, 0.4), st.floats(0.1, 0.2)),
)
placed = st.builds(lambda surface, at: Transformed(surface, translation=at), solid, place)
points = points_around(Sphere(0.8), count=500)


@given(placed, placed)
def test_a_union_contains_the_points_in_either_part(a, b):
    assert torch.equal(Union(a, b).distance(points) < 0, (a.distance(points) < 0) | (b.distance(points) < 0))


@given(placed, placed)
def test_an_intersection_contains_the_points_in_both_parts(a, b):
    both = (a.distance(points) < 0) & (b.distance(points) < 0)
    assert torch.equal(Intersection(a, b).distance(points) < 0, both)


@given(placed, placed)
def test_a_difference_contains_the_points_in_the_first_and_not_the_second_part(a, b):
    kept = (a.distance(points) < 0) & ~(b.distance(points) <= 0)
    assert torch.equal(Difference(a, b).distance(points) < 0, kept)


@given(placed, placed)
def test_the_order_of_parts_does_not_matter(a, b):
    for operation in (Union, Intersection):
        assert torch.equal(operation(a, b).distance(points), operation(b, a).distance(points))
        assert torch.equal(operation(a, b).bounds(), operation(b, a).bounds())


@given(placed, placed, placed)
def test_nesting_does_not_matter(a, b, c):
    assert torch.equal(Union(a, b, c).distance(points), Union(a, Union(b, c)).distance(points))


BALLS = (Sphere(0.3), Transformed(Sphere(0.25), translation=(0.25, 0.0, 0.1)))


@pytest.mark.parametrize("operation", [Union, Intersection, Difference])
def test_the_distance_is_a_bound_and_exact_outside_a_union(operation):
    solid = operation(*BALLS)
    query = points_around(solid, count=3000)
    true = MeshSurface(polygonize(solid, 128), exact=True).distance(query)
    distance = solid.distance(query)
    assert (distance.abs() <= true.abs() + 1e-3).all()
    if operation is Union:
        outside = true > 0.01
        torch.testing.assert_close(distance[outside], true[outside], atol=1e-3, rtol=0)


@given(placed, placed)
def test_bounds_contain_the_solid(a, b):
    for operation in (Union, Intersection, Difference):
        whole = operation(a, b)
        lower, upper = whole.bounds().double()
        within = points[whole.distance(points) < 0]
        assert ((within >= lower - 1e-6) & (within <= upper + 1e-6)).all()


def test_gradients_reach_the_parameters_of_every_part():
    values = [torch.tensor(v, dtype=torch.float64, requires_grad=True) for v in (0.3, 0.25)]
    query = points_around(Sphere(0.5), count=60, seed=2).requires_grad_()
    for operation in (Union, Intersection, Difference):

        def distance(query, first, second, operation=operation):
            shift = Transformed(Sphere(second), translation=(0.25, 0.0, 0.1))
            return operation(Sphere(first), shift).distance(query)

        assert torch.autograd.gradcheck(distance, (query, *values), eps=1e-7, atol=1e-6)


def test_operations_without_parts_are_refused():
    with pytest.raises(InputError, match="union: has no parts"):
        Union()
    with pytest.raises(InputError, match="intersection: has no parts"):
        Intersection()
