"""Evaluation of trajectories in which water enters and leaves."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.datasets.windows import Windows
from surfsup.errors import InputError
from surfsup.evaluation.load_trajectories import check_finite, scene_difference
from surfsup.evaluation.rollout import write_rollout
from surfsup.scene import Scene
from surfsup.sph.solver import DfsphSolver

TEXT = """
container: {size: [0.5, 0.5, 0.6]}
fluid: [{block: {min: [-0.1, -0.1, 0.1], max: [0.1, 0.1, 0.2]}}]
taps: [{disc: {radius: 0.05}, at: [0, 0, 0.5], speed: 2}]
drains: [{box: {size: [0.2, 0.2, 0.1]}, from: 0.1}]
frames: 61
"""
SCENE = Scene.from_yaml(TEXT, "test")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("open") / "00000.h5"
    sf.Simulation(SCENE).record(file)
    return file


def test_a_trajectory_is_as_itself_and_has_lost_no_particle(path):
    with sf.Trajectory(path) as trajectory:
        check_finite(path, trajectory)
        assert trajectory.lifetimes is not None and trajectory.ids(60)[0] > 0
    comparison = sf.evaluate(path, path).evaluation.comparison
    np.testing.assert_allclose(comparison.chamfer, 0)
    np.testing.assert_array_equal(comparison.prediction.lost, 0)


def test_frames_without_water_are_equal(tmp_path):
    scene = Scene.from_yaml("taps: [{disc: {radius: 0.05}, at: [0, 0, 0.5], from: 0.05, speed: 2}]\nframes: 21", "test")
    sf.Simulation(scene).record(tmp_path / "t.h5")
    comparison = sf.evaluate(tmp_path / "t.h5", tmp_path / "t.h5").evaluation.comparison
    for values in (comparison.chamfer, comparison.prediction.height[:10], comparison.prediction.energy[:10]):
        np.testing.assert_array_equal(values, 0)
    assert (comparison.prediction.height[12:] > 0).all()
    with sf.Trajectory(tmp_path / "t.h5") as reference:
        assert np.isfinite(write_rollout(tmp_path / "r.h5", DfsphSolver(), "dfsph", reference, 21))


def test_a_rollout_has_the_same_taps_and_drains(path, tmp_path):
    with sf.Trajectory(path) as reference:
        assert 0 <= write_rollout(tmp_path / "r.h5", DfsphSolver(), "dfsph", reference, 61) <= 1
        with sf.Trajectory(tmp_path / "r.h5") as rollout:
            np.testing.assert_array_equal(rollout.lifetimes, reference.lifetimes)
            np.testing.assert_allclose(rollout.positions[:], reference.positions[:], atol=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "difference"),
    [
        ("speed: 2", "speed: 2.1", "taps"),
        ("[0, 0, 0.5]", "[0, 0.1, 0.5]", "taps"),
        ("[0, 0, 0.5]", "[0, 0.001, 0.5]", None),
        ("from: 0.1", "from: 0.2", "drains"),
    ],
)
def test_scenes_with_other_taps_and_drains_differ(old, new, difference):
    assert scene_difference(SCENE, Scene.from_yaml(TEXT.replace(old, new), "test")) == difference


def test_training_refuses_taps_and_drains_in_one_line(path):
    with pytest.raises(
        InputError, match="has water that enters or leaves, which no learned simulator knows; leave it out"
    ):
        Windows(path.parent)
