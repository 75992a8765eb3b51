import numpy as np

from surfsup.scene import quaternion
from surfsup.scene.pose import Pose
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS
from surfsup.splishsplash.solid_motion import SolidMotion


def spinning(time):
    return Pose.of((2 * time, 0, 1), quaternion.about_axis((0, 0, 1), 3 * time))


def test_each_step_has_the_pose_and_the_velocity_that_leads_to_the_next():
    steps = SolidMotion.of(spinning, 4).steps()
    assert steps.shape == (3 * SUBSTEPS + 1, 13)
    np.testing.assert_allclose(steps[:, 0], 2 * SUBSTEP_TIME * np.arange(len(steps)), atol=1e-12)
    np.testing.assert_allclose(steps[:-1, 7:], [[2, 0, 0, 0, 0, 3]] * (len(steps) - 1), atol=1e-9)
    turned = quaternion.about_axis((0, 0, 1), 3 * 7 * SUBSTEP_TIME)
    np.testing.assert_allclose(steps[7, 3:7], np.roll(turned, -1), atol=1e-9)  # the solver's order is x, y, z, w


def test_the_scene_file_has_the_first_pose():
    start = SolidMotion.of(lambda time: Pose.of((1, 2, 3), quaternion.about_axis((0, 2, 0), 0.5)), 2).start
    assert start["isAnimated"] and start["translation"] == [1, 2, 3]
    np.testing.assert_allclose(start["rotationAxis"], (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(start["rotationAngle"], 0.5)
    assert SolidMotion.of(lambda time: Pose.of(), 2).start["rotationAngle"] == 0
