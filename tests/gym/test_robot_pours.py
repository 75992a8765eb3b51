"""The example in which MuJoCo moves an arm and surfsup the water that it pours."""

import runpy

import numpy as np
import pytest

from surfsup.native.dispatch import is_built
from surfsup.scene.examples import examples_folder

pytest.importorskip("mujoco", reason="install surfsup[robotics]")


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_the_arm_bears_the_weight_of_the_water_and_the_water_follows_the_arm():
    example = runpy.run_path(str(examples_folder() / "robot_pours.py"))
    robot = example["RobotWithWater"]()
    particles = robot.simulation.scene
    weight = len(robot.simulation.particles.positions) * 1000 * (2 * particles.particle_radius) ** 3 * 9.81
    records = [robot.step(0.0, 0.0) for _ in range(80)]
    assert -np.mean([record.force[2] for record in records[40:]]) == pytest.approx(weight, rel=0.15)
    # The shoulder holds arm (2 kg, halfway), cup (1 kg) and water, at half a meter.
    held = np.mean([record.shoulder_torque for record in records[40:]])
    assert held == pytest.approx(2 * 9.81 * 0.25 + (9.81 + weight) * 0.5, rel=0.15)
    for frame in range(80):
        record = robot.step(0.004 * frame, 0.004 * frame)
    assert record.in_cup == 1 and record.angles[0] > 0.15
    assert robot.simulation.frame.positions[:, 2].mean() > 0.75
