import numpy as np
import pytest

from surfsup.datasets.recipes.placement import random_place
from surfsup.scene import Container


@pytest.mark.parametrize(
    ("lower", "upper", "expected"), [(-0.1, 0.3, (-0.4, 0.2)), (-0.5, 0.5, (0, 0)), (-0.8, 0.6, (0.1, 0.1))]
)
def test_a_random_place_is_between_the_walls_or_in_the_middle(lower, upper, expected):
    random, container = np.random.default_rng(0), Container(size=(1.0, 1.0, 2.0))
    bounds = np.array([lower, -0.5, 0.0]), np.array([upper, 0.5, 1.0])
    places = np.array([random_place(*bounds, container, random) for _ in range(500)])
    np.testing.assert_allclose([places[:, 0].min(), places[:, 0].max()], expected, atol=0.01)
    assert (places[:, 0] >= expected[0] - 1e-12).all()
    assert (places[:, 0] <= expected[1] + 1e-12).all()
    np.testing.assert_allclose(places[:, 1], 0, atol=1e-12)
