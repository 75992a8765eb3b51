"""The ranges of bowls and funnels contain every design of section 7 of the supplement."""

import numpy as np
import pytest

from surfsup.datasets.recipes import bowls, funnels
from tests.datasets.recipes.drawn import assert_valid, scenes

BOWLS, FUNNELS = scenes("bowls", 40), scenes("funnels", 40)
NUMBERS = pytest.mark.parametrize("index", range(40))


@NUMBERS
def test_every_scene_is_valid(index):
    assert_valid(BOWLS[index], particles=(12**3, 15**3))
    assert_valid(FUNNELS[index], particles=(12**3, 15**3))


def test_every_second_bowl_is_closed_and_the_others_have_a_hole():
    assert all(scene.surface.bowl.filter_radius == 0 for scene in BOWLS[::2])
    for scene in BOWLS[1::2]:
        assert 0.03 <= scene.surface.bowl.filter_radius <= 0.1
        assert scene.surface.bowl.filter_radius <= 0.75 * scene.surface.bowl.capture_radius


@NUMBERS
def test_a_funnel_is_above_the_floor(index):
    funnel = FUNNELS[index].surface.funnel
    bottom = FUNNELS[index].surface.at[2] - funnel.height - funnel.spout - funnel.wall / 2
    assert 0.15 - 1e-9 <= bottom <= 0.5 + 1e-9


def test_the_ranges_contain_the_supplements_designs():
    for low, high in (bowls.CAPTURE_RADIUS, funnels.CAPTURE_RADIUS):
        assert low <= 0.10 <= high
        assert low <= 0.221 <= high
    assert bowls.CAPTURE_RADIUS[0] <= 0.07
    assert bowls.FILTER_RADIUS[0] <= 0.05 <= bowls.FILTER_RADIUS[1]
    assert all(funnels.FILTER_RADIUS[0] <= radius <= funnels.FILTER_RADIUS[1] for radius in (0.0714, 0.09))


def test_the_radii_and_the_place_vary():
    for found in (BOWLS, FUNNELS):
        shapes = [getattr(scene.surface, scene.surface.kind) for scene in found]
        assert np.std([shape.capture_radius for shape in shapes]) > 0.05
        assert np.std([scene.surface.at[2] for scene in found]) > 0.08
        assert np.std([scene.surface.at[0] for scene in found]) > 0.08
    assert np.std([scene.surface.funnel.filter_radius for scene in FUNNELS]) > 0.01
