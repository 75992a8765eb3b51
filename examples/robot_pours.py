"""MuJoCo moves a robot arm, surfsup the water that it pours; forces go both ways.

    python examples/robot_pours.py -o out/robot.h5 && surfsup view out/robot.h5

Two hinges with servos lift a cup of water and tilt it over a bowl. In every frame MuJoCo gets the force of the water on
the cup, and surfsup the pose at which the arm then has the cup. Prints angles, the torque of the shoulder and where the
water is. It needs ``pip install 'surfsup[robotics]'``.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import surfsup as sf
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter

RADIUS, WALL, HEIGHT = 0.11, 0.02, 0.3  # meters: of the inside of the cup
SIDE = 0.18  # meters: of the arm beside the plane in which the cup moves
BOWL = 0.82, 0.23  # meters: where the bowl is along x, and its radius
SMOOTHING = 0.2  # of a new force in the mean that the arm gets: a frame of water alone is too noisy
ARM = f"""
<mujoco>
  <option timestep="0.0005" gravity="0 0 -9.81" integrator="implicitfast"/>
  <worldbody>
    <body name="arm" pos="0 0 0.75">
      <joint name="shoulder" axis="0 -1 0" damping="4"/>
      <geom type="capsule" fromto="0 {SIDE} 0 0.5 {SIDE} 0" size="0.03" mass="2"/>
      <body name="cup" pos="0.5 0 0">
        <joint name="wrist" axis="0 1 0" damping="1"/>
        <geom type="cylinder" size="{RADIUS + WALL} {HEIGHT / 2}" mass="1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="1500" kv="80"/>
    <position name="wrist" joint="wrist" kp="150" kv="8"/>
  </actuator>
</mujoco>
"""
SCENE = f"""
particle_radius: 0.012
container: {{size: [2.2, 0.8, 1.8]}}
surfaces:
  bowl:
    bowl: {{capture_radius: {BOWL[1]}, wall: 0.03}}
    at: [{BOWL[0]}, 0, 0.26]
  cup:
    difference:
      - cylinder: {{radius: {RADIUS + WALL}, height: {HEIGHT}}}
      - cylinder: {{radius: {RADIUS}, height: {HEIGHT + 1}}}
        at: [0, 0, {WALL + 0.5}]
    at: [0.5, 0, 0.75]
    motion: {{keyframes: [{{time: 0}}]}}
  arm:
    union:
      - cylinder: {{radius: 0.03, height: 0.56}}
        rotate: {{axis: [0, 1, 0], degrees: 90}}
        at: [0.25, {SIDE}, 0]
      - cylinder: {{radius: 0.05, height: 0.09}}                  # shoulder and wrist
        rotate: {{axis: [1, 0, 0], degrees: 90}}
        at: [0, {SIDE}, 0]
      - cylinder: {{radius: 0.025, height: {SIDE - RADIUS - WALL + 0.02}}}
        rotate: {{axis: [1, 0, 0], degrees: 90}}
        at: [0.5, {(SIDE + RADIUS + WALL) / 2}, 0]
    at: [0, 0, 0.75]
    motion: {{keyframes: [{{time: 0}}]}}
  post:
    cylinder: {{radius: 0.045, height: 0.75}}
    at: [0, {SIDE + 0.09}, 0.375]
fluid:
  - fill: {{below: {0.75 + 0.08}, seed: [0.5, 0, 0.72], settle: true}}
forces: [cup]
"""


@dataclass(frozen=True)
class Record:
    """The state at one time.

    Attributes:
        time: seconds.
        angles: (2,) of shoulder and wrist, rad.
        force: (3,) of the water on the cup as the arm gets it, N.
        shoulder_torque: of the servo, N m.
        in_cup, in_bowl: shares of the water.
    """

    time: float
    angles: np.ndarray
    force: np.ndarray
    shoulder_torque: float
    in_cup: float
    in_bowl: float


class RobotWithWater:
    """A robot arm with a cup, and the water in it."""

    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_string(ARM)
        self.data = mujoco.MjData(self.model)
        self.arm, self.cup = (mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name) for name in ("arm", "cup"))
        self.simulation = sf.Simulation(sf.Scene.from_yaml(SCENE, "robot"), device="cpu")
        self.substeps = round(self.simulation.scene.units.frame_time / self.model.opt.timestep)
        self.model.opt.timestep = self.simulation.scene.units.frame_time / self.substeps
        weight = self.simulation.scene.density * (2 * self.simulation.scene.particle_radius) ** 3 * 9.81
        self.force = np.array([0.0, 0.0, -weight * len(self.simulation.particles.positions)])
        self.torque = np.zeros(3)

    def step(self, shoulder: float, wrist: float) -> Record:
        """Advance arm and water by a frame, with the servos at these angles in rad."""
        data = self.data
        data.ctrl[:] = shoulder, wrist
        for _ in range(self.substeps):
            # The torque is about the origin of the cup, which is also its center of mass here.
            data.xfrc_applied[self.cup] = np.concatenate([self.force, self.torque])
            mujoco.mj_step(self.model, data)
        mujoco.mj_forward(self.model, data)
        for name, number in (("arm", self.arm), ("cup", self.cup)):
            self.simulation.set_pose(name, data.xpos[number], data.xquat[number])
        frame = self.simulation.step()
        force, torque = frame.forces["cup"]
        self.force = (1 - SMOOTHING) * self.force + SMOOTHING * force
        self.torque = (1 - SMOOTHING) * self.torque + SMOOTHING * torque
        return self._record(frame)

    def _record(self, frame: sf.Frame) -> Record:
        own = frame.poses["cup"].to_own(frame.positions)
        in_cup = (np.hypot(own[:, 0], own[:, 1]) < RADIUS) & (np.abs(own[:, 2]) < HEIGHT / 2)
        place = frame.positions - [BOWL[0], 0, 0]
        in_bowl = (np.hypot(place[:, 0], place[:, 1]) < BOWL[1]) & (place[:, 2] < 0.3) & ~in_cup
        torque = float(self.data.actuator_force[0])
        shares = float(in_cup.mean()), float(in_bowl.mean())
        return Record(frame.time, self.data.qpos.copy(), self.force.copy(), torque, *shares)


def plan(time: float) -> tuple[float, float]:
    """Angles of shoulder and wrist in rad: lift for a second, then tilt for two."""
    lift = 0.35 * ease((time - 0.3) / 1.0)
    tilt = np.radians(115) * ease((time - 1.5) / 2.0)
    return lift, lift + tilt


def ease(part: float) -> float:
    """A smooth way from 0 to 1."""
    part = min(1.0, max(0.0, part))
    return part * part * (3 - 2 * part)


def main() -> None:
    """Pour, and print how it goes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=4.5)
    parser.add_argument("-o", "--out", type=Path, help="A trajectory file.")
    arguments = parser.parse_args()
    robot, records, frames = RobotWithWater(), [], []
    while robot.simulation.time < arguments.seconds:
        records.append(robot.step(*plan(robot.simulation.time)))
        frames.append(robot.simulation.frame)
        if len(records) % 40 == 1:
            now = records[-1]
            print(
                f"{now.time:5.2f} s  shoulder {np.degrees(now.angles[0]):6.1f}°  "
                f"wrist {np.degrees(now.angles[1]):6.1f}°  "
                f"water on the cup {now.force[2]:7.1f} N  shoulder {now.shoulder_torque:6.1f} N m  "
                f"in the cup {now.in_cup:4.2f}, in the bowl {now.in_bowl:4.2f}",
                flush=True,
            )
    if arguments.out is not None:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        scene = robot.simulation.scene.with_frames(len(frames))
        with TrajectoryWriter(
            arguments.out, scene, Provenance("dfsph with MuJoCo"), len(frames[0].positions)
        ) as writer:
            for frame in frames:
                writer.append(frame.positions, frame.velocities, frame.poses, forces=frame.forces)


if __name__ == "__main__":
    main()
