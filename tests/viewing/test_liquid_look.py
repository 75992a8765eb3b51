import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.scene import Block, Fluid, Scene
from surfsup.scene.liquid import LIQUIDS, Liquid
from surfsup.viewing.liquid_look import WATER, color_of, look_of, looks_of, mixed_look


def test_water_looks_as_water_whatever_its_viscosity():
    for liquid in (None, Liquid(), Liquid(viscosity=0.3), LIQUIDS["water"]):
        assert look_of(liquid) is WATER


def test_honey_is_amber_and_a_color_counts_more():
    honey = look_of(LIQUIDS["honey"])
    red, green, blue = honey.scattering
    assert red > green > blue and (np.diff(honey.absorption) > 0).all(), "blue light is swallowed, red light passes"
    np.testing.assert_array_equal(look_of(Liquid(viscosity=7.0e-3)).scattering, honey.scattering)
    assert color_of(Liquid(viscosity=7.0e-3, color=(0, 0.5, 0))) == (0, 0.5, 0)
    green = look_of(Liquid(color=(0, 0.5, 0)))
    assert green.absorption.argmin() == 1 and green.absorption.min() > 0


def test_a_color_has_three_parts_from_0_to_1():
    with pytest.raises(InputError, match="color"):
        Liquid(color=(0, 0, 255))
    with pytest.raises(InputError, match="color"):
        Liquid(color=(0, 0))


def test_a_scene_has_a_look_for_each_of_its_liquids():
    block = Block((-0.1, -0.1, 0.3), (0.1, 0.1, 0.5))
    both = Scene(fluid=[Fluid(block=block, liquid="water"), Fluid(block=block, liquid="honey")])
    water, honey = looks_of(both)
    assert water is WATER
    np.testing.assert_array_equal(honey.scattering, look_of(LIQUIDS["honey"]).scattering)
    assert looks_of(Scene(fluid=[block])) == [WATER]


def test_a_ray_has_the_mean_look_of_what_it_passes():
    honey = look_of(LIQUIDS["honey"])
    of_water, of_honey = np.array([0.1, 0.03, 0.0], np.float32), np.array([0.0, 0.01, 0.0], np.float32)
    mixed = mixed_look([WATER, honey], [of_water, of_honey])
    np.testing.assert_allclose(mixed.absorption[:, 0], WATER.absorption, rtol=1e-3)
    np.testing.assert_allclose(mixed.scattering[:, 1], 0.75 * WATER.scattering + 0.25 * honey.scattering, rtol=1e-3)
    assert np.isfinite(mixed.absorption).all()
