"""Trajectories of several liquids."""

import h5py
import numpy as np
import pytest

from surfsup.continuation import Continuation
from surfsup.errors import InputError
from surfsup.exporting.source import FrameSource
from surfsup.io.trajectory import Trajectory
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.simulation import Simulation

pytestmark = pytest.mark.skipif(not is_built(), reason="liquids need the C++ code")

TEXT = """
fluid:
  - {block: {min: [-0.1, -0.1, 0.2], max: [0.1, 0.1, 0.3]}, liquid: {density: 600}}
  - block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.4]}
taps: [{disc: {radius: 0.03}, at: [0.3, 0, 0.5], speed: 2, liquid: {density: 600}}]
frames: 12
"""


@pytest.fixture
def recorded(tmp_path):
    scene = Scene.from_yaml(TEXT, "test")
    Simulation(scene).record(tmp_path / "water.h5")
    return tmp_path / "water.h5"


def test_a_trajectory_says_which_liquid_each_particle_is(recorded):
    with Trajectory(recorded) as trajectory:
        blocks = len(trajectory.scene.initial_particles(None).positions)
        assert (trajectory.liquids[: blocks // 2] == 0).all() and (trajectory.liquids[blocks // 2 : blocks] == 1).all()
        assert len(trajectory.liquids) > blocks and (trajectory.liquids[blocks:] == 0).all()
        *_, last = FrameSource(trajectory)
        np.testing.assert_array_equal(last.liquids, trajectory.liquids[last.ids])


def test_a_restart_and_a_continuation_keep_the_liquids(recorded):
    scene = Scene.from_yaml(TEXT, "test")
    restarted = Simulation(scene.with_changes(restart=recorded))
    with Trajectory(recorded) as trajectory:
        np.testing.assert_array_equal(restarted.frame.liquids, trajectory.liquids[trajectory.ids(11)])
    longer = Continuation(recorded, scene.with_frames(15), "dfsph", Simulation)
    frames = list(longer.frames())
    assert len(frames) == 15
    for frame in frames:
        assert len(frame.positions) == len(frame.ids) == len(frame.liquids)
    assert (frames[-1].liquids[: len(frames[3].liquids)] == frames[3].liquids).all()


def test_a_restart_with_other_liquids_is_refused(recorded):
    other = Scene.from_yaml(TEXT.replace("600", "700"), "test").with_changes(restart=recorded)
    with pytest.raises(InputError, match=r"has liquids of 600, 1000 kg/m³, but the scene liquids of 700, 1000 kg/m³"):
        Simulation(other)


def test_numbers_of_liquids_that_are_not_there_are_refused(recorded):
    with h5py.File(recorded, "a") as file:
        file["00000/liquid"][0] = 7
    with pytest.raises(InputError, match=r"is not a trajectory of surfsup, or was cut off \(its liquids"):
        Trajectory(recorded)
