import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.scene import SPACING, Block, Scene
from surfsup.scene.fluid import lattice_sites


@pytest.mark.parametrize(
    ("size", "count"), [(0.06, 1), (0.0899, 1), (0.09, 2), (0.3, 9), (0.4, 12), (0.45, 14), (0.5, 15)]
)
def test_a_side_has_one_lattice_site_fewer_than_whole_spacings(size, count):
    assert lattice_sites(0.0, size) == count
    assert lattice_sites(-size / 2, size / 2) == count


def test_the_lattice_starts_one_spacing_inside_the_block():
    positions = Block(min=(-0.1, 0.0, 1.0), max=(0.0, 0.07, 1.13)).positions()
    assert positions.dtype == np.float32
    x, y, z = (np.unique(column) for column in positions.T)
    np.testing.assert_allclose(x, [-0.07, -0.04], atol=1e-6)
    np.testing.assert_allclose(y, [0.03], atol=1e-6)
    np.testing.assert_allclose(z, [1.03, 1.06, 1.09], atol=1e-6)
    assert len(positions) == 2 * 1 * 3


def test_a_block_takes_its_corners_by_position():
    block = Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7), velocity=(0, 0, -1))
    assert block == Block(min=(-0.1, -0.1, 0.5), max=(0.1, 0.1, 0.7), velocity=(0.0, 0.0, -1.0))
    assert Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7)).velocity == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("maximum", "message"),
    [
        ((1.0, 1.0, float("nan")), "Block: max.2: Input should be a finite number"),
        ((1.0, 1.0), "Block: max.2: is missing"),
    ],
)
def test_an_invalid_block_is_an_error_of_one_line(maximum, message):
    with pytest.raises(InputError) as error:
        Block((0.0, 0.0, 0.0), maximum)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


coordinates = st.floats(-5, 5)
sides = st.floats(2.01 * SPACING, 0.4)


@given(st.tuples(coordinates, coordinates, coordinates), st.tuples(sides, sides, sides))
def test_particles_are_a_spacing_apart_and_a_spacing_inside_the_block(low, size):
    high = tuple(a + b for a, b in zip(low, size, strict=True))
    block = Block(min=low, max=high)
    positions = block.positions()
    assert (positions >= np.array(low) + 0.99 * SPACING).all()
    assert (positions <= np.array(high) - 0.99 * SPACING + 1e-4 * SPACING).all()
    assert (positions >= np.array(high) - 2.01 * SPACING).any(axis=0).all()
    bounds = np.array(block.particle_bounds())
    np.testing.assert_allclose(positions.min(axis=0), bounds[:, 0], atol=1e-6)
    np.testing.assert_allclose(positions.max(axis=0), bounds[:, 1], atol=1e-6)
    for column in positions.T:
        np.testing.assert_allclose(np.diff(np.unique(column)), SPACING, atol=1e-5)


def test_a_block_with_exchanged_corners_and_fluid_that_is_no_list_are_refused():
    with pytest.raises(InputError, match=r"min is above max along z \(0\.7 and 0\.5\); exchange them"):
        Block((-0.1, -0.1, 0.7), (0.1, 0.1, 0.5))
    with pytest.raises(InputError, match=r"fluid is a list, as in \[Block\(\.\.\.\)\]"):
        Scene(fluid=Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7)))
