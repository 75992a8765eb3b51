"""The extent of a turned primitive is what its finest mesh would show."""

import numpy as np
import pytest

from surfsup.datasets.recipes.extent import extent, lowest_point, support
from surfsup.datasets.recipes.prim_shapes import SHAPES, turned
from surfsup.scene import Shape
from surfsup.sdf import polygonize


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_the_extent_is_that_of_a_fine_mesh(kind, seed):
    random = np.random.default_rng(seed)
    shape = turned(kind(random), random).model_copy(update={"scale": 0.7, "at": (0.1, -0.2, 0.3)})
    mesh = polygonize(shape.surface(), 100)  # which cuts corners off
    lower, upper = extent(shape)
    assert (lower <= mesh.bounds[0] + 1e-5).all()
    assert (upper >= mesh.bounds[1] - 1e-5).all()
    np.testing.assert_allclose([lower, upper], mesh.bounds, atol=0.01)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("seed", range(5))
def test_the_lowest_point_lies_on_the_surface_and_on_the_lowest_level(kind, seed):
    import torch

    random = np.random.default_rng(seed)
    shape = turned(kind(random), random).model_copy(update={"at": (0.1, -0.2, 0.3)})
    point = lowest_point(shape)
    assert point[2] == pytest.approx(extent(shape)[0][2], abs=1e-9)
    assert abs(float(shape.surface().distance(torch.as_tensor(point[None])))) < 1e-6


@pytest.mark.parametrize("kind", SHAPES)
def test_along_its_own_axes_a_primitive_reaches_as_far_as_its_bounds(kind):
    shape = Shape(**kind(np.random.default_rng(1)))
    np.testing.assert_allclose(extent(shape), shape.surface().bounds().numpy(), atol=1e-6)
    assert np.isfinite(support(getattr(shape, shape.kind), np.array([0.0, 0.0, 1.0]))).all()
