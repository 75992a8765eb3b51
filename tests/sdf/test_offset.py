import numpy as np
import pytest
import torch
import trimesh

from surfsup.native.dispatch import is_built
from surfsup.sdf import Box, MeshSurface, Sphere, Transformed
from surfsup.sdf.offset import Offset

POINTS = torch.tensor(np.random.default_rng(0).uniform(-0.6, 0.6, (200, 3)), dtype=torch.float32)


@pytest.mark.parametrize("distance", [-0.05, 0.0, 0.1])
def test_a_ball_grown_or_shrunk_is_the_ball_of_that_radius(distance):
    ball, other = Offset(Sphere(0.3), distance), Sphere(0.3 + distance)
    torch.testing.assert_close(ball.distance(POINTS), other.distance(POINTS), atol=1e-6, rtol=0)
    torch.testing.assert_close(ball.bounds(), other.bounds())
    for found, expected in zip(ball.distance_and_normal(POINTS), other.distance_and_normal(POINTS), strict=True):
        torch.testing.assert_close(found, expected, atol=1e-6, rtol=0)
    assert ball.exact_outside == (distance >= 0)


def test_a_shrunk_box_has_the_sign_of_the_smaller_box():
    shrunk, smaller = Offset(Box((0.6, 0.4, 0.8)), -0.1), Box((0.4, 0.2, 0.6))
    assert torch.equal(shrunk.distance(POINTS) < 0, smaller.distance(POINTS) < 0)
    assert (shrunk.distance(POINTS) <= smaller.distance(POINTS) + 1e-6).all()  # a bound
    torch.testing.assert_close(shrunk.bounds(), smaller.bounds())


@pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
def test_the_native_code_has_the_same_values():
    placed = Transformed(Offset(Box((0.6, 0.4, 0.8)), -0.1), translation=(0.05, 0, 0.1), scale=0.5)
    native = placed.distance_and_normal(POINTS)  # in C++
    own = placed.to_own_frame(POINTS)
    distance, normal = Box((0.6, 0.4, 0.8)).distance_and_normal(own.double())
    torch.testing.assert_close(native[0].double(), 0.5 * (distance + 0.1), atol=1e-6, rtol=0)
    torch.testing.assert_close(native[1].double(), normal, atol=1e-5, rtol=0)


def test_the_digest_knows_surface_and_distance():
    meshes = [MeshSurface(trimesh.creation.box(extents=(size, 1, 1))) for size in (1, 2)]
    digests = {Offset(surface, by).content() for surface in meshes for by in (0.0, 0.1)}
    assert None not in digests and len(digests) == 4
    assert Offset(Sphere(0.3), 0.1).content() is None  # made in no time
