"""Parts are added, subtracted and displaced at the right place, and the result is one closed solid."""

import numpy as np
import pytest

from surfsup.datasets.procedural.sculpting import SculptureGrid, ellipsoid, rounded_box, smooth_minimum, tapered_capsule


def empty_grid():
    return SculptureGrid((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), 0.02)


def test_an_ellipsoid_a_box_and_a_tube_have_their_volume():
    for add_part, volume in (
        (lambda c: c.add_ellipsoid((0.1, 0.0, 0.0), (0.3, 0.2, 0.25)), 4 / 3 * np.pi * 0.3 * 0.2 * 0.25),
        (lambda c: c.add_box((-0.2, -0.3, -0.1), (0.3, 0.3, 0.4)), 0.5 * 0.6 * 0.5),
        (lambda c: c.add_tube([(0, 0, -0.2), (0, 0, 0.2)], [0.1, 0.1]), np.pi * 0.01 * (0.4 + 4 / 3 * 0.1)),
    ):
        grid = empty_grid()
        add_part(grid)
        mesh = grid.to_mesh()
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(volume, rel=0.02)


def test_parts_are_subtracted_and_surfaces_displaced():
    grid = empty_grid()
    grid.add_box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3))
    whole = grid.to_mesh().volume
    low, high = np.array([-0.1, -0.1, 0.0]), np.array([0.1, 0.1, 0.4])
    grid.subtract(rounded_box(low, high), low, high)
    assert grid.to_mesh().volume == pytest.approx(whole - 0.2 * 0.2 * 0.3, rel=0.01)
    grid.displace(lambda x, y, z: 0.02 + 0 * (x + y + z), np.full(3, -0.5), np.full(3, 0.5))
    np.testing.assert_allclose(grid.to_mesh().bounds, [[-0.28] * 3, [0.28] * 3], atol=0.003)


def test_separate_pieces_and_cavities_are_not_part_of_the_mesh():
    grid = empty_grid()
    grid.add_ellipsoid((0.0, 0.0, 0.0), (0.3, 0.3, 0.3))
    volume_before = grid.to_mesh().volume
    grid.add_ellipsoid((0.42, 0.42, 0.42), (0.05, 0.05, 0.05))
    cavity = np.full(3, -0.1), np.full(3, 0.1)
    grid.subtract(ellipsoid(np.zeros(3), np.full(3, 0.1)), *cavity)
    mesh = grid.to_mesh()
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(volume_before, rel=1e-6)


def test_fields_are_distances_near_their_surface():
    x, y, z = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 2000))
    upright = tapered_capsule(np.array([0, 0, -0.2]), np.array([0, 0, 0.2]), 0.1, 0.1)
    to_upright = np.sqrt(x * x + y * y + np.clip(np.abs(z) - 0.2, 0, None) ** 2) - 0.1
    ball = ellipsoid(np.zeros(3), np.full(3, 0.3))
    for field, true in ((upright, to_upright), (ball, np.sqrt(x * x + y * y + z * z) - 0.3)):
        near = np.abs(true) < 0.05
        np.testing.assert_allclose(field(x, y, z)[near], true[near], atol=1e-6)


def test_a_smooth_minimum_differs_from_the_minimum_only_where_both_are_close():
    a, b = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    smooth = smooth_minimum(a, b, 0.2)
    apart = np.abs(a - b) >= 0.2
    np.testing.assert_array_equal(smooth[apart], np.minimum(a, b)[apart])
    assert (smooth[~apart] < np.minimum(a, b)[~apart]).all()
    assert (np.minimum(a, b) - smooth).max() <= 0.05 + 1e-12
    np.testing.assert_array_equal(smooth_minimum(a, b, 0.0), np.minimum(a, b))
