import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.evaluate import evaluate, judge_file
from surfsup.evaluation.load_trajectories import data_sets, usable_truths
from surfsup.evaluation.rollout import roll_out
from surfsup.evaluation.scores import ALL, ratios
from surfsup.evaluation.summary import summaries
from surfsup.io.trajectory import Trajectory
from tests.evaluation.scenes import FRAMES, SCENE, Replay, free_fall, silent, write


def test_a_rollout_is_written_beside_its_truth(truth, tmp_path):
    told = []
    share = roll_out(silent(), truth, FRAMES, tmp_path / "out.h5", "silent", "cpu", True, told.append)
    with Trajectory(tmp_path / "out.h5") as rollout:
        np.testing.assert_array_equal(rollout.positions[0], truth.positions[0])
        np.testing.assert_allclose(rollout.positions[:], truth.positions[:], atol=3e-5)
        assert (rollout.provenance.model, rollout.scene.frames, len(rollout)) == ("silent", FRAMES, FRAMES)
    assert told == list(range(1, FRAMES + 1))
    assert share == 0


def test_the_share_of_guarded_particles_is_a_mean_over_frames(truth, tmp_path):
    replay = Replay(truth.positions[:], truth.velocities[:], moved=True)
    assert roll_out(replay, truth, FRAMES, tmp_path / "out.h5", "replay", "cpu", True, lambda done: None) == 1


@pytest.mark.parametrize("spoil", [0, 1], ids=["positions", "velocities"])
def test_a_rollout_that_blows_up_is_as_long_as_the_truth_and_lost(truth, tmp_path, spoil):
    frames = list(free_fall())
    frames[spoil][8, 3] = np.nan
    roll_out(Replay(*frames), truth, FRAMES, tmp_path / "out.h5", "replay", "cpu", True, lambda done: None)
    with Trajectory(tmp_path / "out.h5") as rollout:
        assert len(rollout) == FRAMES
        assert np.isnan(rollout.positions[8:]).all()
    judged = judge_file(tmp_path / "out.h5", tmp_path / "00000.h5")
    assert judged.scores[ALL]["chamfer"] is None
    assert judged.scores[ALL]["lost"] == (FRAMES - 8) * truth.positions.shape[1]


def test_a_trajectory_judged_as_its_own_repeat_is_exactly_the_floor(truth, tmp_path):
    positions, velocities = free_fall()
    positions += np.linspace(0, 0.01, FRAMES, dtype=np.float32)[:, None, None]
    velocities *= np.linspace(1, 1.2, FRAMES, dtype=np.float32)[:, None, None]
    positions[15, :3] = [0, 0, 0.3]  # in the ball
    other = write(tmp_path / "other" / "00000.h5", positions, velocities)
    judged = judge_file(other, tmp_path / "00000.h5", [other, other])
    for values in ratios(judged.scores, judged.floor).values():
        assert {key: value for key, value in values.items() if value is not None and value != pytest.approx(1)} == {}
    assert judged.scores[ALL]["penetration"] == 3
    assert judged.scores[ALL]["depth"] == pytest.approx(-0.3)


@pytest.fixture
def judged(tmp_path):
    """A ballistic model on two falls over a ball, of which one has a floor, and one in an empty container."""
    bare = SCENE.model_copy(update={"surface": None})
    positions, velocities = free_fall()
    for name in ("00000.h5", "00001.h5"):
        write(tmp_path / "falls" / name, positions, velocities)
    write(tmp_path / "falls/00002.h5", positions, velocities, bare)
    write(tmp_path / "falls/floor/00000-1.h5", positions + np.float32(0.001), velocities)
    truths, _ = usable_truths(data_sets([tmp_path / "falls"]))
    told = []
    scenes = evaluate(silent(), "silent", truths, tmp_path / "report", "cpu", tell=lambda *now: told.append(now))
    assert told[-1] == (3 * FRAMES, 3 * FRAMES)
    return scenes


def test_every_scene_is_judged_and_its_rollout_kept(judged, tmp_path):
    assert [(scene.name, scene.judgment.surface) for scene in judged] == [
        ("00000", "sphere"),
        ("00001", "sphere"),
        ("00002", "none"),
    ]
    for scene in judged:
        assert scene.rollout.is_file()
        assert scene.judgment.scores[ALL]["chamfer"] < 3e-5
    assert judged[0].rollout == tmp_path / "report/trajectories/falls/00000.h5"
    assert [len(scene.judgment.floors) for scene in judged] == [1, 0, 0]


def test_means_are_by_surface_and_of_all_and_the_ratio_is_over_scenes_with_a_floor(judged):
    sphere, bare, every = summaries(judged)
    assert [(mean.data, mean.surface, mean.scenes, mean.floors) for mean in (sphere, bare, every)] == [
        ("falls", "sphere", 2, 1),
        ("falls", "none", 1, 0),
        ("falls", "all", 3, 1),
    ]
    assert every.model[ALL]["chamfer"] == pytest.approx(
        np.mean([scene.judgment.scores[ALL]["chamfer"] for scene in judged])
    )
    assert every.floor[ALL] == judged[0].judgment.floor[ALL]
    assert every.ratio[ALL]["chamfer"] == pytest.approx(
        judged[0].judgment.scores[ALL]["chamfer"] / judged[0].judgment.floor[ALL]["chamfer"]
    )
    assert (bare.floor, bare.ratio) == ({}, {})


def test_a_file_that_is_damaged_is_named(truth, tmp_path):
    with pytest.raises(InputError, match="there is no such trajectory file"):
        judge_file(tmp_path / "gone.h5", tmp_path / "00000.h5")
