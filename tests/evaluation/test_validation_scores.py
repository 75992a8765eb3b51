import math

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.validation_scores import Scores, judge, mean_scores, rollout_scores
from surfsup.io.trajectory import Trajectory
from tests.evaluation.scenes import FRAMES, SCENE, Replay, silent, write


def test_the_truth_against_itself_scores_zero_and_one(truth):
    replay = Replay(truth.positions[:], truth.velocities[:])
    assert rollout_scores(replay, truth, FRAMES) == Scores(0, 0, 0, 1, 0, 0, 0)


def test_a_ballistic_model_is_the_truth_while_the_water_falls(truth):
    scores = rollout_scores(silent(), truth, FRAMES)
    assert scores.chamfer < 3e-5
    assert scores.height_error < 1e-5
    assert scores.energy_ratio == pytest.approx(1, abs=2e-3)
    assert (scores.inside, scores.outside, scores.handle_collisions) == (0, 0, 0)


def test_scores_worked_by_hand(truth):
    positions, velocities = truth.positions[:], truth.velocities[:]
    positions[:, :, 2] += 0.001  # one millimeter too high, far less than the spacing
    velocities = velocities * np.float32(2)
    positions[5, 0] = [0.0, 0.0, 0.3]  # in the ball
    positions[6, :2] = [0.0, 0.9, 1.0]  # through the wall
    scores = rollout_scores(Replay(positions, velocities, moved=True), truth, 5)
    assert scores.chamfer == pytest.approx(0.002, rel=1e-3)
    assert scores.chamfer_squared == pytest.approx(2e-6, rel=1e-3)
    assert scores.height_error == pytest.approx(0.001, rel=1e-3)
    assert scores.energy_ratio == pytest.approx(4)
    assert (scores.inside, scores.outside, scores.handle_collisions) == (0, 0, 1)
    later = rollout_scores(Replay(positions, velocities), truth, FRAMES)
    assert (later.inside, later.outside) == (1, 2)


def test_a_rollout_is_scored_over_the_frames_that_the_truth_has(truth):
    replay = Replay(truth.positions[:], truth.velocities[:])
    assert rollout_scores(replay, truth, 1000) == rollout_scores(replay, truth, FRAMES)


@pytest.mark.parametrize("spoil", ["positions", "velocities"])
def test_a_rollout_that_blows_up_is_no_number_from_there_on(truth, spoil):
    frames = {"positions": truth.positions[:], "velocities": truth.velocities[:]}
    frames[spoil][8] = np.nan
    assert rollout_scores(Replay(**frames), truth, 5).chamfer == 0
    scores = rollout_scores(Replay(**frames), truth, FRAMES)
    assert math.isnan(scores.chamfer)
    assert scores.rank == math.inf


def test_water_at_rest_has_no_energy_to_compare(tmp_path):
    positions = np.repeat(SCENE.start(None).positions[None], 3, axis=0)
    write(tmp_path / "rest.h5", positions, np.zeros_like(positions))
    with Trajectory(tmp_path / "rest.h5") as truth:
        same = rollout_scores(Replay(positions, np.zeros_like(positions)), truth, 3)
        moving = rollout_scores(Replay(positions, np.ones_like(positions)), truth, 3)
    assert same.energy_ratio == 1
    assert moving.energy_ratio == math.inf
    assert moving.rank == math.inf


def test_means_are_of_averages_and_counts_are_summed():
    both = mean_scores([Scores(1, 2, 3, 0.5, 4, 5, 0.1), Scores(3, 4, 5, 1.5, 6, 7, 0.3)])
    assert both == Scores(2, 3, 4, 1.0, 10, 12, pytest.approx(0.2))


def test_a_smaller_rank_is_a_better_model():
    perfect = Scores(0, 0, 0, 1, 0, 0, 0)
    assert perfect.rank == 0
    worse = [Scores(0.01, 0, 0, 1, 0, 0, 0), Scores(0, 0, 0.1, 1, 0, 0, 0), Scores(0, 0, 0, 2, 0, 0, 0)]
    assert all(scores.rank > 0 for scores in worse)
    assert Scores(0, 0, 0, 0.5, 0, 0, 0).rank == pytest.approx(Scores(0, 0, 0, 2.0, 0, 0, 0).rank)
    assert Scores(math.nan, 0, 0, 1, 0, 0, 0).rank == math.inf
    assert math.isfinite(Scores(0, 0, 0, 0, 0, 0, 0).rank)


def test_judging_takes_the_first_scenes_of_a_folder(truth, tmp_path):
    (tmp_path / "00001.h5").write_text("not read, because it is the second")
    (scores,) = judge(silent(), tmp_path, scenes=1, frames=6)
    assert scores.chamfer < 3e-5


def test_an_empty_folder_cannot_judge(tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        list(judge(silent(), tmp_path, scenes=1, frames=6))
