import math

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.validation_scores import ValidationScores, combine_scores, score_rollout, score_rollouts
from surfsup.io.trajectory import Trajectory
from surfsup.sph.solver import DfsphSolver
from tests.evaluation.scenes import FRAMES, SCENE, Replay, write


def test_the_reference_itself_has_no_error_and_energy_ratio_one(reference):
    replay = Replay(reference.positions[:], reference.velocities[:])
    assert score_rollout(replay, reference, FRAMES) == ValidationScores(0, 0, 0, 1, 0, 0, 0)


def test_a_ballistic_simulator_has_no_error_while_the_water_falls(reference):
    scores = score_rollout(DfsphSolver(), reference, FRAMES)
    assert scores.chamfer < 3e-5
    assert scores.height_error < 1e-5
    assert scores.energy_ratio == pytest.approx(1, abs=2e-3)
    assert (scores.inside, scores.outside, scores.collided_share) == (0, 0, 0)


def test_scores_worked_by_hand(reference):
    positions, velocities = reference.positions[:], reference.velocities[:]
    positions[:, :, 2] += 0.001  # one millimeter too high, far less than the spacing
    velocities = velocities * np.float32(2)
    positions[5, 0] = [0.0, 0.0, 0.3]  # inside the ball
    positions[6, :2] = [0.0, 0.9, 1.0]  # through the wall
    scores = score_rollout(Replay(positions, velocities, collided=True), reference, 5)
    assert scores.chamfer == pytest.approx(0.002, rel=1e-3)
    assert scores.chamfer_squared == pytest.approx(2e-6, rel=1e-3)
    assert scores.height_error == pytest.approx(0.001, rel=1e-3)
    assert scores.energy_ratio == pytest.approx(4)
    assert (scores.inside, scores.outside, scores.collided_share) == (0, 0, 1)
    later = score_rollout(Replay(positions, velocities), reference, FRAMES)
    assert (later.inside, later.outside) == (1, 2)


def test_a_rollout_is_scored_over_the_reference_s_frames_at_most(reference):
    replay = Replay(reference.positions[:], reference.velocities[:])
    assert score_rollout(replay, reference, 1000) == score_rollout(replay, reference, FRAMES)


@pytest.mark.parametrize("spoiled", ["positions", "velocities"])
def test_a_diverged_rollout_has_no_chamfer_and_an_infinite_selection_error(reference, spoiled):
    frames = {"positions": reference.positions[:], "velocities": reference.velocities[:]}
    frames[spoiled][8] = np.nan
    assert score_rollout(Replay(**frames), reference, 5).chamfer == 0
    scores = score_rollout(Replay(**frames), reference, FRAMES)
    assert math.isnan(scores.chamfer)
    assert scores.selection_error == math.inf


def test_the_energy_ratio_of_water_at_rest_is_one(tmp_path):
    positions = np.repeat(SCENE.initial_particles(None).positions[None], 3, axis=0)
    write(tmp_path / "rest.h5", positions, np.zeros_like(positions))
    with Trajectory(tmp_path / "rest.h5") as reference:
        same = score_rollout(Replay(positions, np.zeros_like(positions)), reference, 3)
        moving = score_rollout(Replay(positions, np.ones_like(positions)), reference, 3)
    assert same.energy_ratio == 1
    assert moving.energy_ratio == math.inf
    assert moving.selection_error == math.inf


def test_averages_are_averaged_and_counts_are_summed():
    both = combine_scores([ValidationScores(1, 2, 3, 0.5, 4, 5, 0.1), ValidationScores(3, 4, 5, 1.5, 6, 7, 0.3)])
    assert both == ValidationScores(2, 3, 4, 1.0, 10, 12, pytest.approx(0.2))


def selection_error(chamfer: float = 0, height_error: float = 0, energy_ratio: float = 1) -> float:
    return ValidationScores(chamfer, 0, height_error, energy_ratio, 0, 0, 0).selection_error


def test_the_selection_error_is_smaller_for_a_better_simulator():
    assert selection_error() == 0
    assert selection_error(chamfer=0.01) > 0
    assert selection_error(height_error=0.1) > 0
    assert selection_error(energy_ratio=2) > 0
    assert selection_error(energy_ratio=0.5) == pytest.approx(selection_error(energy_ratio=2))
    assert selection_error(chamfer=math.nan) == math.inf
    assert math.isfinite(selection_error(energy_ratio=0))


def test_the_first_scenes_of_a_folder_are_scored(reference, tmp_path):
    (tmp_path / "00001.h5").write_text("not read: only the first is scored")
    (scores,) = score_rollouts(DfsphSolver(), tmp_path, scenes=1, frames=6)
    assert scores.chamfer < 3e-5


@pytest.mark.parametrize("handle_collisions", [True, False])
def test_rollouts_have_collision_handling_if_it_is_requested(reference, tmp_path, handle_collisions):
    replay = Replay(reference.positions[:], reference.velocities[:])
    list(score_rollouts(replay, tmp_path, scenes=1, frames=3, handle_collisions=handle_collisions))
    assert replay.handled_collisions == handle_collisions


def test_a_folder_without_trajectories_is_rejected(tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        list(score_rollouts(DfsphSolver(), tmp_path, scenes=1, frames=6))
