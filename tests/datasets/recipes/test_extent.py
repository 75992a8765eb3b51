"""The extent of a rotated primitive is that of a fine mesh of it."""

import numpy as np
import pytest

from surfsup.datasets.recipes.extent import extent, lowest_point, support_point
from surfsup.datasets.recipes.prim_shapes import SHAPES, rotated
from surfsup.sdf import polygonize


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_the_extent_is_that_of_a_fine_mesh(kind, seed):
    random = np.random.default_rng(seed)
    shape = rotated(kind(random), random).model_copy(update={"scale": 0.7, "at": (0.1, -0.2, 0.3)})
    mesh = polygonize(shape.surface(), 100)  # marching cubes cuts the corners off
    lower, upper = extent(shape)
    assert (lower <= mesh.bounds[0] + 1e-5).all()
    assert (upper >= mesh.bounds[1] - 1e-5).all()
    np.testing.assert_allclose([lower, upper], mesh.bounds, atol=0.01)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("seed", range(5))
def test_the_lowest_point_is_on_the_surface_and_at_the_lowest_height(kind, seed):
    import torch

    random = np.random.default_rng(seed)
    shape = rotated(kind(random), random).model_copy(update={"at": (0.1, -0.2, 0.3)})
    point = lowest_point(shape)
    assert point[2] == pytest.approx(extent(shape)[0][2], abs=1e-9)
    assert abs(float(shape.surface().distance(torch.as_tensor(point[None])))) < 1e-6


@pytest.mark.parametrize("kind", SHAPES)
def test_without_a_rotation_the_extent_is_the_surfaces_bounds(kind):
    shape = kind(np.random.default_rng(1))
    np.testing.assert_allclose(extent(shape), shape.surface().bounds().numpy(), atol=1e-6)
    assert np.isfinite(support_point(getattr(shape, shape.kind), np.array([0.0, 0.0, 1.0]))).all()
