import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surfsup.scene.nozzle import Nozzle, disc_lattice, nozzle_axes, rectangle_lattice

SPACING = 0.03


def nozzle(interval=0.1, start=0.0, until=math.inf):
    half = np.array([0.05, 0.05])
    return Nozzle(np.zeros(3), nozzle_axes((0, 0, -1)), np.zeros((4, 2)), half, True, 1.0, interval, start, until, 0.06)


@given(st.floats(0.016, 0.4))
def test_a_layer_of_a_disc_holds_the_volume_that_flows_between_two_layers(radius):
    points, distance = disc_lattice(radius, SPACING)
    assert math.pi * radius**2 * distance == pytest.approx(len(points) * SPACING**3)
    assert np.hypot(*points.T).max() < 1.05 * radius
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-9)


@given(st.floats(0.05, 0.4))
def test_a_wide_disc_has_the_density_at_rest_in_all_directions(radius):
    points, distance = disc_lattice(radius, SPACING)
    nearest = np.sort(np.linalg.norm(points[:, None] - points, axis=-1), axis=1)[:, 1]
    assert nearest.min() == pytest.approx(nearest.max())
    assert nearest.min() ** 2 * distance == pytest.approx(SPACING**3)
    assert 0.85 < distance / SPACING < 1.2


def test_a_rectangle_of_whole_spacings_has_the_cubic_lattice():
    points, distance = rectangle_lattice((0.09, 0.06), SPACING)
    assert distance == pytest.approx(SPACING)
    assert sorted(set(points[:, 0].round(9))) == [-0.03, 0.0, 0.03]
    assert sorted(set(points[:, 1].round(9))) == [-0.015, 0.015]


def test_the_axes_of_a_horizontal_tap_are_level_before_it_is_turned():
    side, other, forward = nozzle_axes((2, 0, 0))
    np.testing.assert_allclose([side, other, forward], [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(nozzle_axes((2, 0, 0), 90.0)[0], [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("direction", [(0, 0, -1), (0, 0, 1), (1, 2, -3), (-1, 0, 0)])
def test_axes_are_a_right_handed_rotation(direction):
    axes = nozzle_axes(direction, 33.0)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


class TestWayOut:
    """A disc of 5 cm that points down, with layers 10 cm apart, guides water up to 0.2 m and half a layer."""

    def way(self, point, tap=None):
        ways, ahead = (tap or nozzle()).way_out(np.array([point], float), front=0.2)
        return ways[0], ahead[0]

    @pytest.mark.parametrize("point", [(0.06, 0, -0.1), (0, 0, 0.06), (0, 0, -0.26), (0, 0.05, -0.1)])
    def test_points_outside_stay(self, point):
        way, ahead = self.way(point)
        assert not way.any() and not ahead

    def test_the_shortest_way_out_is_sideways_back_or_ahead(self):
        np.testing.assert_allclose(self.way((0.04, 0, -0.1))[0], (0.01, 0, 0), atol=1e-12)
        np.testing.assert_allclose(self.way((0, 0, 0.045))[0], (0, 0, 0.005), atol=1e-12)
        way, ahead = self.way((0, 0, -0.245))
        np.testing.assert_allclose(way, (0, 0, -0.005), atol=1e-12)
        assert ahead

    def test_a_rectangle_is_left_through_its_nearest_side(self):
        axes = nozzle_axes((0, 0, -1))
        tap = Nozzle(np.zeros(3), axes, np.zeros((4, 2)), np.array([0.1, 0.05]), False, 1.0, 0.1, 0.0, 9.0, 0.06)
        np.testing.assert_allclose(self.way((0.08, 0.02, -0.1), tap)[0], (0.02, 0, 0), atol=1e-12)
        np.testing.assert_allclose(self.way((0.02, -0.04, -0.1), tap)[0], (0, -0.01, 0), atol=1e-12)


def test_layers_pass_the_opening_in_the_middle_of_their_intervals():
    np.testing.assert_allclose(nozzle().layer_times(0.0, 0.26), [0.05, 0.15, 0.25])
    np.testing.assert_allclose(nozzle(start=1.0, until=1.2).layer_times(0.0, 9.0), [1.05, 1.15])


@given(st.floats(1e-4, 0.05), st.floats(0.0, 0.3), st.floats(0.0, 0.5), st.integers(1, 60))
def test_frames_one_after_the_other_lose_no_layer_and_repeat_none(interval, start, open_for, frames):
    tap = nozzle(interval, start, start + open_for)
    ends = 0.005 * np.arange(frames + 1)
    parts = [tap.layer_times(*pair) for pair in itertools.pairwise(ends)]
    np.testing.assert_array_equal(np.concatenate(parts), tap.layer_times(0.0, ends[-1]))
    assert tap.count(0.0, ends[-1]) == 4 * sum(map(len, parts))


def test_the_volume_is_that_of_the_flow_to_half_a_layer():
    tap = nozzle(0.013)
    for time in np.linspace(0, 2, 37):
        assert abs(tap.count(0.0, time) / 4 - time / 0.013) <= 0.5 + 1e-6
