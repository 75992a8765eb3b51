"""The child process of one simulation: ``python -m surfsup.splishsplash.child_process SCENE FRAMES STEPS_PER_FRAME``.

Its standard output is the number of particles as one int64, then for each frame positions (N, 3) and velocities (N, 3)
as raw float32. The solver's messages go to standard error.

SPlisHSPlasH allows one simulation per process, and its crash must not end the caller.
"""

from __future__ import annotations

import os
import sys
from types import ModuleType

import numpy as np

from surfsup.splishsplash.library import load_solver

VELOCITY_FILE = "velocities.npy"  # of each particle, beside the scene, where the velocities of a block differ


def run(scene_file: str, frames: int, steps_per_frame: int, output: int) -> None:
    """Simulate ``frames`` frames of ``scene_file`` and write them to the file descriptor ``output``."""
    solver = load_solver()
    base = solver.Exec.SimulatorBase()
    base.init(
        sceneFile=scene_file,
        programName="surfsup",
        useCache=False,
        outputDir=os.path.join(os.path.dirname(scene_file), "solver-log"),
        initialPause=False,
        useGui=False,
        stopAt=-1.0,
    )
    base.initSimulation()
    base.setValueFloat(base.STOP_AT, 1e9)
    fluid = solver.Simulation.getCurrent().getFluidModel(0)
    count = fluid.numActiveParticles()
    os.write(output, np.int64(count).tobytes())
    velocities = os.path.join(os.path.dirname(scene_file), VELOCITY_FILE)
    if os.path.exists(velocities):
        order = np.array(fluid.getFieldBuffer("id"), copy=False)[:count]
        np.array(fluid.getFieldBuffer("velocity"), copy=False)[:count] = np.load(velocities)[order]
    step = 0

    def send_frame() -> None:
        # The solver sorts its particles; a particle's id is its index at the start.
        order = np.argsort(np.array(fluid.getFieldBuffer("id"), copy=False)[:count])
        for field in ("position", "velocity"):
            values = np.array(fluid.getFieldBuffer(field), copy=False)[:count]
            write_all(output, values[order].astype(np.float32, copy=False).tobytes())

    motion_file = os.path.join(os.path.dirname(scene_file), "motions.npy")
    motions = np.load(motion_file, allow_pickle=False) if os.path.exists(motion_file) else []

    def after_step() -> None:
        nonlocal step
        step += 1
        for table in motions:
            place_solid(solver, int(table[0, 13]), table[step])
        if step % steps_per_frame == 0:
            send_frame()
        if step == (frames - 1) * steps_per_frame:
            base.setValueFloat(base.STOP_AT, 1e-9)  # any time in the past; 0 would mean never

    send_frame()
    if frames > 1:
        base.setTimeStepCB(after_step)
        base.runSimulation()
    base.cleanup()


def place_solid(solver: ModuleType, boundary: int, row: np.ndarray) -> None:
    """Give the solid of a boundary the pose and velocity of ``row``, see :mod:`surfsup.splishsplash.solid_motion`."""
    solid = solver.Simulation.getCurrent().getBoundaryModel(boundary).getRigidBodyObject()
    place, rotation, velocity, spin = np.split(row[:13].astype(np.float32), [3, 7, 10])
    solid.setPosition(place)
    solid.setRotation(rotation)
    solid.setVelocity(velocity)
    solid.setAngularVelocity(spin)


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of ``data``; a pipe may accept a part only."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


if __name__ == "__main__":
    frames_out = os.dup(1)
    os.dup2(2, 1)
    run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), frames_out)
