import numpy as np

from surfsup.live.following import SPEED, TURN, towards
from surfsup.scene import quaternion
from surfsup.scene.pose import Pose

FAR = Pose.of((1.0, 0, 0), quaternion.about_axis((0, 0, 1), 0.2))


def test_a_solid_follows_at_a_limited_speed_and_arrives():
    pose, steps = Pose.of(), 0
    while pose is not FAR:
        following = towards(pose, FAR, 0.005)
        assert np.linalg.norm(following.position - pose.position) <= 0.005 * SPEED * (1 + 1e-9)
        pose, steps = following, steps + 1
    assert steps == round(1 / SPEED / 0.005)


def test_a_turn_takes_its_time_too():
    target = Pose.of((0, 0, 0), quaternion.about_axis((1, 0, 0), 1.0))
    half = towards(Pose.of(), target, 0.5 / TURN)
    np.testing.assert_allclose(quaternion.logarithm(half.rotation), [0.5, 0, 0], atol=1e-9)
    assert towards(Pose.of(), target, 0.5 / TURN, scale=3) is target
