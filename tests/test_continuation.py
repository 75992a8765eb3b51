"""An interrupted simulation is continued; `tests/cli/test_resume.py` interrupts the program itself."""

from itertools import islice

import h5py
import numpy as np
import pytest

from surfsup import InputError, Scene, Simulation, Trajectory
from surfsup.continuation import Continuation
from surfsup.io.output_folder import OutputFolder
from surfsup.io.trajectory_format import Provenance

SCENE = """
surface: {sphere: {radius: 0.15}, at: [0, 0, 0.15]}
fluid: [{block: {min: [-0.1, -0.1, 0.33], max: [0.1, 0.1, 0.5]}}]
frames: 12
"""
TAP = """
container: {size: [1, 1, 1]}
taps: [{disc: {radius: 0.06}, at: [0, 0, 0.3], speed: 1}]
drains: [{box: {size: [1, 1, 0.1]}}]
frames: 60
"""
MOVING = """
surfaces:
  paddle: {box: {size: [0.3, 0.05, 0.2]}, at: [0, 0, 0.1], motion: {spin: {axis: [0, 0, 1], turns: 1}}}
fluid: [{block: {min: [-0.1, -0.1, 0.33], max: [0.1, 0.1, 0.5]}}]
forces: all
frames: 12
"""


def simulate(scene):
    return Simulation(scene, device="cpu")


def written(folder, scene, frames):
    """The first frames of a scene as an interrupted run leaves them."""
    scene = scene if isinstance(scene, Scene) else Scene.from_yaml(scene, "test")
    simulation = simulate(scene)
    output = OutputFolder(folder, simulation.most_ids(), scene.frames)
    run = [frame.recorded for frame in islice(simulation.run(), frames)]
    output.record(scene, simulation.motion.solids, run, Provenance("dfsph"), "cpu", lambda done, total: None)
    return scene, output


@pytest.mark.parametrize("text", [SCENE, MOVING, TAP], ids=["still", "moving", "taps"])
def test_the_frames_of_the_file_stay_and_the_rest_follows(tmp_path, text):
    scene, output = written(tmp_path / "a", text, Scene.from_yaml(text, "test").frames // 2)
    _, whole = written(tmp_path / "b", text, scene.frames)
    rest = Continuation(output.trajectory, scene, "dfsph", simulate)
    solids = rest.simulation.motion.solids
    folder = OutputFolder(tmp_path / "a", rest.most_ids, scene.frames)
    summary = folder.record(scene, solids, rest.frames(), Provenance("dfsph"), "cpu", lambda done, total: None)
    assert summary.frames == scene.frames
    with Trajectory(folder.trajectory) as ours, Trajectory(whole.trajectory) as theirs:
        assert ours.start_time == 0
        assert ours.scene.to_yaml() == theirs.scene.to_yaml()
        assert ours.positions.shape == theirs.positions.shape
        half = scene.frames // 2
        np.testing.assert_array_equal(ours.positions[:half], theirs.positions[:half])
        for number in range(scene.frames):
            np.testing.assert_array_equal(ours.ids(number), theirs.ids(number))
        np.testing.assert_allclose(ours.positions[:], theirs.positions[:], atol=1e-4)
        assert list(ours.poses) == list(theirs.poses)
        for name, poses in ours.poses.items():
            np.testing.assert_allclose(poses, theirs.poses[name], atol=1e-9)
        for name, forces in ours.forces.items():
            np.testing.assert_allclose(forces, theirs.forces[name], atol=0.3)


def test_more_frames_may_be_requested(tmp_path):
    scene, output = written(tmp_path, SCENE, 12)
    rest = Continuation(output.trajectory, scene.with_frames(15), "dfsph", simulate)
    assert len(list(rest.frames())) == 15


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (SCENE, "has all 12 frames already; give more --frames"),
        (SCENE.replace("0.15}", "0.14}"), "is of another scene or other options"),
        (SCENE + "gravity: [0, 0, -1]", "is of another scene or other options"),
    ],
)
def test_what_cannot_be_continued_is_refused_in_one_line(tmp_path, changed, message):
    _, output = written(tmp_path, SCENE, 12)
    with pytest.raises(InputError, match=message) as error:
        Continuation(output.trajectory, Scene.from_yaml(changed, "changed"), "dfsph", simulate)
    assert "\n" not in str(error.value)
    assert str(output.trajectory) in str(error.value)


def test_without_a_file_there_is_nothing_to_continue(tmp_path):
    with pytest.raises(InputError, match="there is no interrupted simulation; omit --resume"):
        Continuation(tmp_path / "trajectory.h5", Scene.from_yaml(SCENE, "test"), "dfsph", simulate)


def test_particles_that_met_in_a_splash_do_not_stop_it(tmp_path):
    scene, output = written(tmp_path, SCENE, 6)
    with h5py.File(output.trajectory, "a") as file:
        positions = file["00000/position"][:]
        positions[-1, 1] = positions[-1, 0] + np.float32(1e-4)
        file["00000/position"][:] = positions
    assert len(list(Continuation(output.trajectory, scene, "dfsph", simulate).frames())) == 12


def test_another_simulator_is_refused(tmp_path):
    scene, output = written(tmp_path, SCENE, 6)
    with pytest.raises(InputError, match="was simulated by dfsph, not by surfsup; give the same --simulator"):
        Continuation(output.trajectory, scene, "surfsup", simulate)


BOAT = (
    SCENE.replace("surface: {sphere: {radius: 0.15}, at: [0, 0, 0.15]}", "")
    + "surfaces: {boat: {box: {size: [0.2, 0.2, 0.1]}, at: [0, 0, 0.15], rigid_body: {density: 500}}}\n"
)


def test_rigid_bodies_continue_with_their_velocities(tmp_path):
    scene, output = written(tmp_path, BOAT, 6)
    frames = list(Continuation(output.trajectory, scene, "dfsph", simulate).frames())
    whole = list(simulate(scene).run())
    assert len(frames) == len(whole) == 12
    np.testing.assert_array_equal(frames[5].poses["boat"].array, whole[5].poses["boat"].array)
    np.testing.assert_array_equal(frames[5].bodies["boat"], whole[5].bodies["boat"].motion)
    # The velocities of the water are rounded in the file, those of bodies are not.
    for continued, uninterrupted in zip(frames[6:], whole[6:], strict=True):
        np.testing.assert_allclose(continued.poses["boat"].array, uninterrupted.poses["boat"].array, atol=1e-5)
        np.testing.assert_allclose(continued.bodies["boat"][:6], uninterrupted.bodies["boat"].motion[:6], atol=2e-3)


def test_a_body_that_falls_freely_continues_exactly(tmp_path):
    """Nothing rounds a body that the water does not touch."""
    text = BOAT.replace("at: [0, 0, 0.15]", "at: [0.3, 0.3, 1.2]").replace("{density: 500}", "{velocity: [0.1, 0, 1]}")
    scene, output = written(tmp_path, text, 6)
    frames = list(Continuation(output.trajectory, scene, "dfsph", simulate).frames())
    for continued, uninterrupted in zip(frames, simulate(scene).run(), strict=True):
        np.testing.assert_array_equal(continued.poses["boat"].array, uninterrupted.poses["boat"].array)
        np.testing.assert_array_equal(continued.bodies["boat"], uninterrupted.bodies["boat"].motion)


def test_a_file_without_the_velocities_of_bodies_is_refused(tmp_path):
    scene, output = written(tmp_path, BOAT, 6)
    with h5py.File(output.trajectory, "a") as file:
        del file["00000/body"]
    with pytest.raises(InputError, match="does not hold the velocity of the rigid body 'boat'"):
        Continuation(output.trajectory, scene, "dfsph", simulate)


def test_damaged_velocities_of_bodies_are_refused(tmp_path):
    scene, output = written(tmp_path, BOAT, 6)
    with h5py.File(output.trajectory, "a") as file:
        file["00000/body/boat"][-1] = np.nan
    with pytest.raises(InputError, match="the motion of 'boat' is not twelve finite numbers"):
        Continuation(output.trajectory, scene, "dfsph", simulate)
