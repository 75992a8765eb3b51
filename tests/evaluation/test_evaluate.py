import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.evaluate import evaluate, evaluate_trajectory
from surfsup.evaluation.load_trajectories import find_data_sets, load_references
from surfsup.evaluation.scores import ALL, floor_ratios
from surfsup.evaluation.summary import summaries
from surfsup.sph.solver import DfsphSolver
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write


def test_a_trajectory_evaluated_as_its_own_repeat_is_exactly_at_the_floor(reference, tmp_path):
    positions, velocities = free_fall()
    positions += np.linspace(0, 0.01, FRAMES, dtype=np.float32)[:, None, None]
    velocities *= np.linspace(1, 1.2, FRAMES, dtype=np.float32)[:, None, None]
    positions[15, :3] = [0, 0, 0.3]  # inside the ball
    other = write(tmp_path / "other" / "00000.h5", positions, velocities)
    evaluation = evaluate_trajectory(other, tmp_path / "00000.h5", [other, other])
    for values in floor_ratios(evaluation.scores, evaluation.floor).values():
        assert {key: value for key, value in values.items() if value is not None and value != pytest.approx(1)} == {}
    assert evaluation.scores[ALL]["penetration"] == 3
    assert evaluation.scores[ALL]["depth"] == pytest.approx(-0.3)


@pytest.fixture
def evaluated(tmp_path):
    """A ballistic simulator on two falls over a ball, one with a floor, and on one fall in an empty container."""
    empty = SCENE.model_copy(update={"surface": None})
    positions, velocities = free_fall()
    for name in ("00000.h5", "00001.h5"):
        write(tmp_path / "falls" / name, positions, velocities)
    write(tmp_path / "falls/00002.h5", positions, velocities, empty)
    write(tmp_path / "falls/floor/00000-1.h5", positions + np.float32(0.001), velocities)
    references, _ = load_references(find_data_sets([tmp_path / "falls"]))
    calls = []
    scenes = evaluate(
        DfsphSolver(), "ballistic", references, tmp_path / "report", progress=lambda *call: calls.append(call)
    )
    assert calls[-1] == (3 * FRAMES, 3 * FRAMES)
    return scenes


def test_every_scene_is_evaluated_and_its_rollout_kept(evaluated, tmp_path):
    assert [(scene.name, scene.evaluation.surface) for scene in evaluated] == [
        ("00000", "sphere"),
        ("00001", "sphere"),
        ("00002", "none"),
    ]
    for scene in evaluated:
        assert scene.rollout.is_file()
        assert scene.evaluation.scores[ALL]["chamfer"] < 3e-5
    assert evaluated[0].rollout == tmp_path / "report/trajectories/falls/00000.h5"
    assert [len(scene.evaluation.floor_comparisons) for scene in evaluated] == [1, 0, 0]


def test_means_are_by_surface_and_of_all_and_the_ratio_is_over_scenes_with_a_floor(evaluated):
    sphere, empty, every = summaries(evaluated)
    assert [(mean.data_set, mean.surface, mean.scenes, mean.floors) for mean in (sphere, empty, every)] == [
        ("falls", "sphere", 2, 1),
        ("falls", "none", 1, 0),
        ("falls", "all", 3, 1),
    ]
    assert every.scores[ALL]["chamfer"] == pytest.approx(
        np.mean([scene.evaluation.scores[ALL]["chamfer"] for scene in evaluated])
    )
    with_floor = evaluated[0].evaluation
    assert every.floor[ALL] == with_floor.floor[ALL]
    assert every.ratio[ALL]["chamfer"] == pytest.approx(
        with_floor.scores[ALL]["chamfer"] / with_floor.floor[ALL]["chamfer"]
    )
    assert (empty.floor, empty.ratio) == ({}, {})


def test_a_missing_file_is_named(reference, tmp_path):
    with pytest.raises(InputError, match="there is no such trajectory file"):
        evaluate_trajectory(tmp_path / "gone.h5", tmp_path / "00000.h5")
