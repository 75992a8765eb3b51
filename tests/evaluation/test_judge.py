import json
import math

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.evaluation.judge import Scores, judge, mean_scores, rollout_scores
from surfsup.evaluation.report import evaluate, means, table, trajectories_in, write_report
from surfsup.model.simulator import Architecture, Simulator
from surfsup.model.state import State
from surfsup.scene import Scene
from surfsup.trajectory import Provenance, Trajectory, TrajectoryWriter

FRAMES = 20
SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\nfluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]",
    "test",
)


def write(path, positions: np.ndarray, velocities: np.ndarray) -> None:
    with TrajectoryWriter(path, SCENE, Provenance("test"), positions.shape[1]) as writer:
        for frame in zip(positions, velocities, strict=True):
            writer.append(*frame)


@pytest.fixture
def truth(tmp_path):
    """A free fall from rest, as the solver falls."""
    start = SCENE.start(None).positions.astype(np.float64)
    steps = 5 * np.arange(FRAMES)
    drop = -9.81 * 1e-6 * steps * (steps + 1) / 2
    positions = start + drop[:, None, None] * np.array([0, 0, 1])
    velocities = np.zeros_like(positions)
    velocities[..., 2] = (-9.81e-3 * steps)[:, None]
    write(tmp_path / "00000.h5", positions.astype(np.float32), velocities.astype(np.float32))
    with Trajectory(tmp_path / "00000.h5") as trajectory:
        yield trajectory


class Replay:
    """A model that plays back given frames."""

    def __init__(self, positions, velocities, moved: bool = False) -> None:
        self.frames, self.moved = list(zip(positions, velocities, strict=True)), moved

    def rollout(self, state, around, frames, guarded):
        for positions, velocities in self.frames[:frames]:
            now, gone = torch.from_numpy(positions), torch.from_numpy(velocities)
            yield State(now, gone, now, gone), torch.full((len(now),), self.moved)


def silent() -> Simulator:
    simulator = Simulator(Architecture(width=4, layers=1))
    for parameter in simulator.parameters():
        torch.nn.init.zeros_(parameter)
    return simulator


def test_the_truth_against_itself_scores_zero_and_one(truth):
    replay = Replay(truth.positions[:], truth.velocities[:])
    assert rollout_scores(replay, truth, [FRAMES]) == {FRAMES: Scores(0, 0, 0, 1, 0, 0, 0)}


def test_a_ballistic_model_is_the_truth_while_the_water_falls(truth):
    scores = rollout_scores(silent(), truth, [FRAMES])[FRAMES]
    assert scores.chamfer < 3e-5
    assert scores.height_error < 1e-5
    assert scores.energy_ratio == pytest.approx(1, abs=2e-3)
    assert (scores.inside, scores.outside, scores.guarded) == (0, 0, 0)


def test_scores_worked_by_hand(truth):
    positions, velocities = truth.positions[:], truth.velocities[:]
    positions[:, :, 2] += 0.001  # one millimetre too high, far less than the spacing
    velocities = velocities * np.float32(2)
    positions[5, 0] = [0.0, 0.0, 0.3]  # in the ball
    positions[6, :2] = [0.0, 0.9, 1.0]  # through the wall
    scores = rollout_scores(Replay(positions, velocities, moved=True), truth, [5])[5]
    assert scores.chamfer == pytest.approx(0.002, rel=1e-3)
    assert scores.chamfer_squared == pytest.approx(2e-6, rel=1e-3)
    assert scores.height_error == pytest.approx(0.001, rel=1e-3)
    assert scores.energy_ratio == pytest.approx(4)
    assert (scores.inside, scores.outside, scores.guarded) == (0, 0, 1)
    later = rollout_scores(Replay(positions, velocities), truth, [FRAMES])[FRAMES]
    assert (later.inside, later.outside) == (1, 2)


def test_several_spans_of_one_rollout_are_what_each_would_score_alone(truth):
    positions = truth.positions[:]
    positions += np.linspace(0, 0.01, FRAMES, dtype=np.float32)[:, None, None]
    replay = Replay(positions, truth.velocities[:])
    together = rollout_scores(replay, truth, [4, 12, 1000])
    assert together[4] == rollout_scores(replay, truth, [4])[4]
    assert together[12] == rollout_scores(replay, truth, [12])[12]
    assert together[1000] == rollout_scores(replay, truth, [FRAMES])[FRAMES]


@pytest.mark.parametrize("spoil", ["positions", "velocities"])
def test_a_rollout_that_blows_up_is_no_number_from_there_on(truth, spoil):
    frames = {"positions": truth.positions[:], "velocities": truth.velocities[:]}
    frames[spoil][8] = np.nan
    scores = rollout_scores(Replay(**frames), truth, [5, FRAMES])
    assert scores[5].chamfer == 0
    assert math.isnan(scores[FRAMES].chamfer)
    assert scores[FRAMES].rank == math.inf


def test_water_at_rest_has_no_energy_to_compare(tmp_path):
    positions = np.repeat(SCENE.start(None).positions[None], 3, axis=0)
    write(tmp_path / "rest.h5", positions, np.zeros_like(positions))
    with Trajectory(tmp_path / "rest.h5") as truth:
        same = rollout_scores(Replay(positions, np.zeros_like(positions)), truth, [3])[3]
        moving = rollout_scores(Replay(positions, np.ones_like(positions)), truth, [3])[3]
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
    assert judge(silent(), tmp_path, scenes=1, frames=6).chamfer < 3e-5


def test_an_empty_folder_cannot_judge(tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        judge(silent(), tmp_path, scenes=1, frames=6)
    with pytest.raises(InputError, match="has no trajectories"):
        trajectories_in(tmp_path)


def test_a_report_holds_every_scene_and_the_means(truth, tmp_path):
    told = []
    scored = evaluate(silent(), trajectories_in(tmp_path), True, lambda done, count: told.append((done, count)))
    assert told == [(1, 1)]
    assert (scored[0].scene, scored[0].kind) == ("00000.h5", "sphere")
    write_report(tmp_path / "report.json", "first", tmp_path, scored)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["mean"]["300"]["chamfer"] == means(scored)[300].chamfer
    assert report["scenes"][0]["spans"]["800"]["inside"] == 0
    text = table(scored)
    assert "00000.h5" in text
    assert "mean" in text
