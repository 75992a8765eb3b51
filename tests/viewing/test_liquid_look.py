import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.scene.liquid import LIQUIDS, Liquid
from surfsup.viewing.liquid_look import WATER, color_of, look_of


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
