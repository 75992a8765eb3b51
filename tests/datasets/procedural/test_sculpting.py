"""Clay: parts put on, cut and carved are where they were put, and what comes out is one closed solid."""

import numpy as np
import pytest

from surfsup.datasets.procedural.sculpting import Clay, bar, box, ellipsoid, smooth_minimum


def clay():
    return Clay((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), 0.02)


def test_a_ball_a_slab_and_a_bar_have_their_volume():
    for put_on, volume in (
        (lambda c: c.ball((0.1, 0.0, 0.0), (0.3, 0.2, 0.25)), 4 / 3 * np.pi * 0.3 * 0.2 * 0.25),
        (lambda c: c.slab((-0.2, -0.3, -0.1), (0.3, 0.3, 0.4)), 0.5 * 0.6 * 0.5),
        (lambda c: c.blob([(0, 0, -0.2), (0, 0, 0.2)], [0.1, 0.1]), np.pi * 0.01 * (0.4 + 4 / 3 * 0.1)),
    ):
        block = clay()
        put_on(block)
        mesh = block.mesh()
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(volume, rel=0.02)


def test_what_is_cut_away_is_gone_and_what_is_carved_is_sunk():
    block = clay()
    block.slab((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3))
    whole = block.mesh().volume
    low, high = np.array([-0.1, -0.1, 0.0]), np.array([0.1, 0.1, 0.4])
    block.cut(box(low, high), low, high)
    assert block.mesh().volume == pytest.approx(whole - 0.2 * 0.2 * 0.3, rel=0.01)
    block.carve(lambda x, y, z: 0.02 + 0 * (x + y + z), np.full(3, -0.5), np.full(3, 0.5))
    np.testing.assert_allclose(block.mesh().bounds, [[-0.28] * 3, [0.28] * 3], atol=0.003)


def test_crumbs_and_bubbles_are_not_part_of_the_mesh():
    block = clay()
    block.ball((0.0, 0.0, 0.0), (0.3, 0.3, 0.3))
    plain = block.mesh().volume
    block.ball((0.42, 0.42, 0.42), (0.05, 0.05, 0.05))
    bubble = np.full(3, -0.1), np.full(3, 0.1)
    block.cut(ellipsoid(np.zeros(3), np.full(3, 0.1)), *bubble)
    mesh = block.mesh()
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(plain, rel=1e-6)


def test_fields_are_distances_near_their_surface():
    x, y, z = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 2000))
    upright = bar(np.array([0, 0, -0.2]), np.array([0, 0, 0.2]), 0.1, 0.1)
    to_upright = np.sqrt(x * x + y * y + np.clip(np.abs(z) - 0.2, 0, None) ** 2) - 0.1
    ball = ellipsoid(np.zeros(3), np.full(3, 0.3))
    for field, true in ((upright, to_upright), (ball, np.sqrt(x * x + y * y + z * z) - 0.3)):
        near = np.abs(true) < 0.05
        np.testing.assert_allclose(field(x, y, z)[near], true[near], atol=1e-6)


def test_a_smooth_minimum_is_the_minimum_but_where_the_two_are_near():
    a, b = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    smooth = smooth_minimum(a, b, 0.2)
    apart = np.abs(a - b) >= 0.2
    np.testing.assert_array_equal(smooth[apart], np.minimum(a, b)[apart])
    assert (smooth[~apart] < np.minimum(a, b)[~apart]).all()
    assert (np.minimum(a, b) - smooth).max() <= 0.05 + 1e-12
    np.testing.assert_array_equal(smooth_minimum(a, b, 0.0), np.minimum(a, b))
