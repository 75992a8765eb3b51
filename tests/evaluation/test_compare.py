import h5py
import numpy as np
import pytest
import torch

from surfsup.evaluation.compare import compare
from surfsup.evaluation.metrics import chamfer, kd_tree, max_density
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene
from surfsup.scene.solids import build_solids
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write

LONG = SCENE.with_frames(40)  # more than one read


@pytest.fixture
def random_pair(tmp_path):
    """A reference and a prediction with particles inside the scene's ball, near it and far from it."""
    random = np.random.default_rng(0)

    def trajectory(name: str, count: int) -> Trajectory:
        positions = random.uniform([-0.49, -0.49, 0], [0.49, 0.49, 0.9], (40, count, 3)).astype(np.float32)
        velocities = random.normal(size=positions.shape).astype(np.float32)
        return Trajectory(write(tmp_path / name, positions, velocities, LONG))

    with trajectory("reference.h5", 50) as reference, trajectory("prediction.h5", 70) as prediction:
        yield reference, prediction


def test_every_curve_equals_a_brute_force_of_its_formula(random_pair):
    reference, prediction = random_pair
    (found,) = compare(reference, [prediction])
    surface = SCENE.build_surface()
    for frame in range(40):
        predicted, true = prediction.positions[frame], reference.positions[frame]
        distances = np.linalg.norm(predicted[:, None].astype(np.float64) - true[None], axis=-1)
        there, back = distances.min(axis=1), distances.min(axis=0)
        predicted_sdf, true_sdf = (surface.distance(torch.from_numpy(points)).numpy() for points in (predicted, true))
        near, true_near = predicted_sdf < 0.09, true_sdf < 0.09
        assert found.chamfer[frame] == pytest.approx(there.mean() + back.mean(), rel=1e-12)
        assert found.chamfer_squared[frame] == pytest.approx((there**2).mean() + (back**2).mean(), rel=1e-12)
        assert found.surface[frame] == pytest.approx(there[near].sum() + back[true_near].sum(), rel=1e-12)
        assert found.surface_squared[frame] == pytest.approx((there[near] ** 2).sum() + (back[true_near] ** 2).sum())
        assert found.prediction.inside[frame] == (predicted_sdf < 0).sum()
        assert found.prediction.depth[frame] == pytest.approx(predicted_sdf[predicted_sdf < 0].sum(), abs=1e-5)
        assert (found.prediction.near[frame], found.reference.near[frame]) == (near.sum(), true_near.sum())
        assert found.prediction.height[frame] == pytest.approx(predicted[:, 2].astype(np.float64).mean())
        assert found.reference.energy[frame] == pytest.approx(
            0.5 * (reference.velocities[frame].astype(np.float64) ** 2).sum(axis=1).mean()
        )
        assert found.prediction.lost[frame] == 0
        if frame % 10 == 0:
            assert found.prediction.density[frame] == pytest.approx(max_density(kd_tree(predicted)))
    assert np.isnan(found.prediction.density[1:10]).all()


def test_the_threshold_decides_which_particles_are_near(random_pair):
    reference, prediction = random_pair
    none, every = (compare(reference, [prediction], threshold)[0] for threshold in (-1.0, 9.0))
    assert not none.surface.any()
    assert every.prediction.near.tolist() == [70] * 40


def test_a_trajectory_has_no_distance_to_itself(reference):
    (found,) = compare(reference, [reference])
    assert not found.chamfer.any()
    assert not found.surface.any()
    np.testing.assert_array_equal(found.prediction.height, found.reference.height)


def test_several_predictions_give_the_comparisons_of_each_alone(random_pair):
    reference, prediction = random_pair
    both = compare(reference, [prediction, reference])
    np.testing.assert_array_equal(both[0].chamfer, compare(reference, [prediction])[0].chamfer)
    assert not both[1].chamfer.any()
    assert both[0].reference is both[1].reference


def test_only_common_frames_are_compared_and_reported(random_pair, tmp_path):
    reference, prediction = random_pair
    short = write(tmp_path / "short.h5", prediction.positions[:7], prediction.velocities[:7])
    calls = []
    with Trajectory(short) as seven:
        assert len(compare(reference, [seven], progress=lambda *call: calls.append(call))[0]) == 7
    assert calls == [(7, 7)]


def test_lost_particles_are_counted_and_the_others_still_compared(reference, tmp_path):
    positions, velocities = free_fall()
    positions[3, 0] = np.nan
    positions[4, :2] = [0.0, 0.9, 1.0]  # through the wall
    velocities[5, 0] = np.inf
    velocities[6, 0, 2] = -31.0
    with Trajectory(write(tmp_path / "a" / "lossy.h5", positions, velocities)) as lossy:
        (found,) = compare(reference, [lossy])
    assert found.prediction.lost.tolist() == [0, 0, 0, 1, 2, 1, 1] + [0] * (FRAMES - 7)
    # The other particles have no error; the reference's particle without a counterpart has a neighbor at one spacing.
    assert found.chamfer[3] == pytest.approx(0.03 / positions.shape[1], rel=1e-3)
    assert found.chamfer[4] == pytest.approx(chamfer(positions[4], free_fall()[0][4]).plain)
    assert np.isfinite(found.prediction.energy).all()


def test_a_diverged_rollout_has_no_values_from_there_on(reference, tmp_path):
    positions, velocities = free_fall()
    positions[8:], velocities[8:] = np.nan, np.nan
    with Trajectory(write(tmp_path / "a" / "broken.h5", positions, velocities)) as broken:
        (found,) = compare(reference, [broken])
    assert not found.chamfer[:8].any()
    assert np.isnan(found.chamfer[8:]).all()
    assert np.isnan(found.prediction.height[8:]).all()
    assert found.prediction.lost[8:].tolist() == [positions.shape[1]] * (FRAMES - 8)


def test_no_particle_is_near_in_an_empty_container(tmp_path):
    empty = SCENE.model_copy(update={"surface": None})
    with Trajectory(write(tmp_path / "empty.h5", *free_fall(4, empty), empty)) as trajectory:
        (found,) = compare(trajectory, [trajectory])
    assert not found.prediction.near.any()
    assert not found.surface.any()


MOVING = Scene.from_yaml(
    "container: {size: [1, 1, 2], motion: {between: linear, keyframes: ["
    "{time: 0}, {time: 0.05, position: [0.1, 0, 0]}]}}\n"
    "surfaces: {ball: {sphere: {radius: 0.1}, motion: {between: linear, keyframes: ["
    "{time: 0, position: [-0.3, 0, 1]}, {time: 0.05, position: [0.3, 0, 1]}]}}}\n"
    "frames: 11\nfluid: [{block: {min: [-0.03, -0.03, 0.97], max: [0.03, 0.03, 1.03]}}]",
    "test",
)


def test_particles_inside_a_solid_that_moves_and_outside_a_container_that_moves_are_counted(tmp_path):
    positions = np.array([[0, 0, 1], [-0.445, 0, 1]], np.float32)
    solids = build_solids(MOVING)
    with TrajectoryWriter(tmp_path / "t.h5", MOVING, Provenance("test"), 2) as writer:
        for number in range(11):
            writer.append(positions, np.zeros_like(positions), solids.poses(number * 0.005))
    with Trajectory(tmp_path / "t.h5") as trajectory:
        (comparison,) = compare(trajectory, [trajectory])
    # The ball covers the first particle in frames 4 to 6; the wall passes the second in frame 6.
    np.testing.assert_array_equal(comparison.prediction.inside, [0, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0])
    np.testing.assert_array_equal(comparison.prediction.lost, [0] * 6 + [1] * 5)


def test_without_poses_in_the_file_solids_are_where_its_own_times_have_them(tmp_path):
    positions = np.zeros((11, 2, 3), np.float32) + np.array([[0, 0, 1], [0.35, 0, 1]], np.float32)
    with h5py.File(write(tmp_path / "t.h5", positions, np.zeros_like(positions), MOVING), "a") as file:
        file.attrs["start_time"] = 0.025
    with Trajectory(tmp_path / "t.h5") as trajectory:
        (comparison,) = compare(trajectory, [trajectory])
    # Frame 0 is at 0.025 s, when the ball is in the middle; from 0.05 s on it rests on the second particle.
    np.testing.assert_array_equal(comparison.prediction.inside, [1, 1, 0, 0, 0, 1, 1, 1, 1, 1, 1])
