"""The child process of one simulation: ``python -m surfsup.splishsplash.child_process SCENE FRAMES STEPS_PER_FRAME``.

Its standard output is the number of particles as one int64, then for each frame positions (N, 3) and velocities (N, 3)
as raw float32. The solver's messages go to standard error. If there are drains, it reads after each frame but the first
the number of particles that these have taken as one int64 from its standard input, then their ids.

SPlisHSPlasH allows one simulation per process, and its crash must not end the caller.
"""

from __future__ import annotations

import os
import sys
from types import ModuleType
from typing import Any

import numpy as np

from surfsup.splishsplash.library import load_solver

ENTERING_FILE = "entering.npy"  # beside the scene, if water enters or leaves; see EnteringWater.table
DRAINS_FILE = "drains"  # beside the scene, empty, if there are drains
PARKING, PARKING_SPACING = 1000.0, 0.25  # meters: beyond every map, and further apart than neighbors
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
    simulation = solver.Simulation.getCurrent()
    fluids = [Fluid(simulation.getFluidModel(number)) for number in range(simulation.numberOfFluidModels())]
    count = sum(fluid.count for fluid in fluids)
    os.write(output, np.int64(count).tobytes())
    velocities = os.path.join(os.path.dirname(scene_file), VELOCITY_FILE)
    if os.path.exists(velocities):
        ends = np.cumsum([fluid.count for fluid in fluids])
        for fluid, values in zip(fluids, np.split(np.load(velocities), ends[:-1]), strict=True):
            fluid.field("velocity")[:] = values[fluid.field("id")]
    step = 0

    def send_frame() -> None:
        # The solver sorts the particles of each fluid; a particle's id is its index in it at the start.
        for field in ("position", "velocity"):
            for fluid in fluids:
                values = fluid.field(field)[np.argsort(fluid.field("id"))]
                write_all(output, values.astype(np.float32, copy=False).tobytes())

    entering = Entering(solver, os.path.dirname(scene_file), count)
    motion_file = os.path.join(os.path.dirname(scene_file), "motions.npy")
    motions = np.load(motion_file, allow_pickle=False) if os.path.exists(motion_file) else []

    def after_step() -> None:
        nonlocal step
        step += 1
        for table in motions:
            place_solid(solver, int(table[0, 13]), table[step])
        entering.after_step(step)
        if step % steps_per_frame == 0:
            send_frame()
            entering.after_frame()
        if step == (frames - 1) * steps_per_frame:
            base.setValueFloat(base.STOP_AT, 1e-9)  # any time in the past; 0 would mean never

    entering.after_step(0)
    send_frame()
    if frames > 1:
        base.setTimeStepCB(after_step)
        base.runSimulation()
    base.cleanup()


class Fluid:
    """The particles of a fluid.

    Args:
        model: of the solver.
    """

    def __init__(self, model: Any) -> None:
        self._model, self.count = model, model.numActiveParticles()

    def field(self, name: str) -> np.ndarray:
        """The values (count, ...) of a field, which can be written."""
        return np.array(self._model.getFieldBuffer(name), copy=False)[: self.count]


class Entering:
    """Places the particles that taps give and takes those that have entered drains.

    Args:
        solver: the module of the solver.
        folder: of the scene.
        count: number of all particles.
    """

    def __init__(self, solver: ModuleType, folder: str, count: int) -> None:
        table = os.path.join(folder, ENTERING_FILE)
        self._table = np.load(table, allow_pickle=False) if os.path.exists(table) else None
        self._drains = os.path.exists(os.path.join(folder, DRAINS_FILE))
        if self._table is None:
            return
        self._solver, self._fluid = solver, solver.Simulation.getCurrent().getFluidModel(0)
        self._count, self._gone = count, np.zeros(count, bool)
        self._absent = np.isin(np.arange(count), self._table[:, 1].astype(int))  # until the table places them
        self._step = solver.Simulation.getCurrent().getTimeStep()
        names = (self._step.MAX_ERROR, self._step.MAX_ERROR_V)
        self._limits = [(name, self._step.getValueFloat(name)) for name in names]
        for row in np.flatnonzero(self._absent[self._ids()]):
            self._fluid.setParticleState(int(row), solver.ParticleState.AnimatedByEmitter)
        self._scale_limits()

    def after_step(self, step: int) -> None:
        """Place and release what the table has for a step."""
        if self._table is None:
            return
        first, end = np.searchsorted(self._table[:, 0], [step, step + 1])
        due = self._table[first:end]
        due = due[~self._gone[due[:, 1].astype(int)]]
        if not len(due):
            return
        order = np.argsort(self._ids())
        positions, velocities = self._field("position"), self._field("velocity")
        states = self._solver.ParticleState
        for _, number, free, *values in due:
            row = int(order[int(number)])
            positions[row], velocities[row] = values[:3], values[3:]
            self._fluid.setParticleState(row, states.Active if free else states.AnimatedByEmitter)
            self._absent[int(number)] = False
        self._scale_limits()

    def after_frame(self) -> None:
        """Park the particles that drains have taken."""
        if not self._drains:
            return
        count = int(np.frombuffer(read_all(0, 8), np.int64)[0])
        taken = np.frombuffer(read_all(0, 8 * count), np.int64)
        if not count:
            return
        rows = np.argsort(self._ids())[taken]
        self._field("position")[rows] = parking_places(taken)
        self._field("velocity")[rows] = 0.0
        for row in rows:
            self._fluid.setParticleState(int(row), self._solver.ParticleState.AnimatedByEmitter)
        self._gone[taken], self._absent[taken] = True, True
        self._scale_limits()

    def _ids(self) -> np.ndarray:
        return np.array(self._fluid.getFieldBuffer("id"), copy=False)[: self._count]

    def _field(self, name: str) -> np.ndarray:
        return np.array(self._fluid.getFieldBuffer(name), copy=False)[: self._count]

    def _scale_limits(self) -> None:
        share = max(1, int((~self._absent).sum())) / self._count
        for name, limit in self._limits:
            self._step.setValueFloat(name, limit * share)


def parking_places(ids: np.ndarray) -> np.ndarray:
    """Where particles (N,) are, (N, 3) float32 in meters, that are not in the scene."""
    side = 256
    sites = np.stack([ids % side, ids // side % side, ids // side**2], axis=1)
    return (PARKING + PARKING_SPACING * sites).astype(np.float32)


def place_solid(solver: ModuleType, boundary: int, row: np.ndarray) -> None:
    """Give the solid of a boundary the pose and velocity of ``row``, see :mod:`surfsup.splishsplash.solid_motion`."""
    solid = solver.Simulation.getCurrent().getBoundaryModel(boundary).getRigidBodyObject()
    place, rotation, velocity, spin = np.split(row[:13].astype(np.float32), [3, 7, 10])
    solid.setPosition(place)
    solid.setRotation(rotation)
    solid.setVelocity(velocity)
    solid.setAngularVelocity(spin)


def read_all(descriptor: int, size: int) -> bytes:
    """Read exactly ``size`` bytes.

    Raises:
        EOFError: the other side has ended.
    """
    parts = []
    while size:
        part = os.read(descriptor, size)
        if not part:
            raise EOFError("the other process has ended")
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of ``data``; a pipe may accept a part only."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


if __name__ == "__main__":
    frames_out = os.dup(1)
    os.dup2(2, 1)
    run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), frames_out)
