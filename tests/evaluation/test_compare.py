import numpy as np
import pytest
import torch

from surfsup.evaluation.compare import compare
from surfsup.evaluation.metrics import chamfer, highest_density, tree
from surfsup.io.trajectory import Trajectory
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write

LONG = SCENE.with_frames(40)  # more than are read at once


@pytest.fixture
def stirred(tmp_path):
    """A truth and a prediction around the ball of the scene, with particles in it, near it and far from it."""
    random = np.random.default_rng(0)

    def made(name: str, count: int) -> Trajectory:
        positions = random.uniform([-0.49, -0.49, 0], [0.49, 0.49, 0.9], (40, count, 3)).astype(np.float32)
        velocities = random.normal(size=positions.shape).astype(np.float32)
        return Trajectory(write(tmp_path / name, positions, velocities, LONG))

    with made("truth.h5", 50) as truth, made("other.h5", 70) as other:
        yield truth, other


def test_every_curve_equals_a_brute_force_of_its_formula(stirred):
    truth, other = stirred
    (found,) = compare(truth, [other])
    surface = SCENE.build_surface()
    for frame in range(40):
        own, true = other.positions[frame], truth.positions[frame]
        apart = np.linalg.norm(own[:, None].astype(np.float64) - true[None], axis=-1)
        there, back = apart.min(axis=1), apart.min(axis=0)
        own_distance, true_distance = (surface.distance(torch.from_numpy(points)).numpy() for points in (own, true))
        near, near_true = own_distance < 0.09, true_distance < 0.09
        assert found.chamfer[frame] == pytest.approx(there.mean() + back.mean(), rel=1e-12)
        assert found.chamfer_squared[frame] == pytest.approx((there**2).mean() + (back**2).mean(), rel=1e-12)
        assert found.surface[frame] == pytest.approx(there[near].sum() + back[near_true].sum(), rel=1e-12)
        assert found.surface_squared[frame] == pytest.approx((there[near] ** 2).sum() + (back[near_true] ** 2).sum())
        assert found.own.inside[frame] == (own_distance < 0).sum()
        assert found.own.depth[frame] == pytest.approx(own_distance[own_distance < 0].sum(), abs=1e-5)
        assert (found.own.near[frame], found.true.near[frame]) == (near.sum(), near_true.sum())
        assert found.own.height[frame] == pytest.approx(own[:, 2].astype(np.float64).mean())
        assert found.true.energy[frame] == pytest.approx(
            0.5 * (truth.velocities[frame].astype(np.float64) ** 2).sum(axis=1).mean()
        )
        assert found.own.lost[frame] == 0
        if frame % 10 == 0:
            assert found.own.density[frame] == pytest.approx(highest_density(tree(own)))
    assert np.isnan(found.own.density[1:10]).all()


def test_a_threshold_says_who_is_near(stirred):
    truth, other = stirred
    nobody, everybody = (compare(truth, [other], threshold)[0] for threshold in (-1.0, 9.0))
    assert not nobody.surface.any()
    assert everybody.own.near.tolist() == [70] * 40


def test_a_trajectory_beside_itself_is_nothing_apart(truth):
    (found,) = compare(truth, [truth])
    assert not found.chamfer.any()
    assert not found.surface.any()
    np.testing.assert_array_equal(found.own.height, found.true.height)


def test_several_are_what_each_would_be_alone(stirred):
    truth, other = stirred
    both = compare(truth, [other, truth])
    np.testing.assert_array_equal(both[0].chamfer, compare(truth, [other])[0].chamfer)
    assert not both[1].chamfer.any()
    assert both[0].true is both[1].true


def test_only_common_frames_are_compared_and_told_of(stirred, tmp_path):
    truth, other = stirred
    short = write(tmp_path / "short.h5", other.positions[:7], other.velocities[:7])
    told = []
    with Trajectory(short) as seven:
        assert len(compare(truth, [seven], tell=lambda *now: told.append(now))[0]) == 7
    assert told == [(7, 7)]


def test_particles_that_get_lost_are_counted_and_the_others_still_compared(truth, tmp_path):
    positions, velocities = free_fall()
    positions[3, 0] = np.nan
    positions[4, :2] = [0.0, 0.9, 1.0]  # through the wall
    velocities[5, 0] = np.inf
    velocities[6, 0, 2] = -31.0
    with Trajectory(write(tmp_path / "a" / "lossy.h5", positions, velocities)) as lossy:
        (found,) = compare(truth, [lossy])
    assert found.own.lost.tolist() == [0, 0, 0, 1, 2, 1, 1] + [0] * (FRAMES - 7)
    # All but the lost one lie where they should; the truth's lost one has a neighbor at one spacing.
    assert found.chamfer[3] == pytest.approx(0.03 / positions.shape[1], rel=1e-3)
    assert found.chamfer[4] == pytest.approx(chamfer(positions[4], free_fall()[0][4]).plain)
    assert np.isfinite(found.own.energy).all()


def test_a_rollout_that_blew_up_has_no_numbers_from_there_on(truth, tmp_path):
    positions, velocities = free_fall()
    positions[8:], velocities[8:] = np.nan, np.nan
    with Trajectory(write(tmp_path / "a" / "broken.h5", positions, velocities)) as broken:
        (found,) = compare(truth, [broken])
    assert not found.chamfer[:8].any()
    assert np.isnan(found.chamfer[8:]).all()
    assert np.isnan(found.own.height[8:]).all()
    assert found.own.lost[8:].tolist() == [positions.shape[1]] * (FRAMES - 8)


def test_an_empty_container_has_no_surface_to_be_near(tmp_path):
    bare = SCENE.model_copy(update={"surface": None})
    with Trajectory(write(tmp_path / "bare.h5", *free_fall(4, bare), bare)) as trajectory:
        (found,) = compare(trajectory, [trajectory])
    assert not found.own.near.any()
    assert not found.surface.any()
