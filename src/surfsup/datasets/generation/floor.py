"""The reproducibility floor: the reference run again with its water moved by 1 mm.

Fluid motion is chaotic, so that even the reference does not reproduce itself from a slightly different start. The
difference between such runs and the original is the floor of every error: no simulator can be required to be closer.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from surfsup.datasets.folder import atomic_write, lock_folder
from surfsup.datasets.generation.checked_simulation import CheckedSimulation, with_retry
from surfsup.datasets.generation.physical_check import UnphysicalError
from surfsup.datasets.generation.progress_estimate import ProgressEstimate
from surfsup.datasets.generation.worker_pool import open_worker_pool, until_canceled
from surfsup.datasets.units import check_simulator_frames
from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_path import trajectory_files
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Block, Fluid, InitialParticles, Scene
from surfsup.scene.solids import build_solids
from surfsup.splishsplash import solver
from surfsup.splishsplash.entering_water import with_ids

FOLDER = "floor"
SHIFT = 0.001  # meters, with particles of 15 mm; in proportion with others
AXES = 3  # one run for each axis that the water moves along


class FloorWarning(UserWarning):
    """A trajectory is unreadable, or its scene could not be run again."""


def simulate_floor(
    data: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int, float | None], None] | None = None,
) -> list[Path]:
    """Run the reference three times more for each trajectory in ``data``; runs that are there already are kept.

    The water of run 1 starts 1 mm further along x, that of run 2 along y, that of run 3 along z, that of taps too. The
    trajectories are ``floor/NAME-1.h5`` to ``floor/NAME-3.h5`` in ``data``, with as many frames as the original. If a
    run fails, ``floor/NAME-1.failed.txt`` has the reason.

    Args:
        data: folder of trajectories by the reference solver.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler to use instead; its workers must share ``data`` under the same path.
        progress: called with the numbers of finished and of all runs, and the remaining seconds, None if unknown.

    Returns:
        The floor's trajectories.

    Raises:
        InputError: the folder has no readable trajectory, a scene continues another trajectory or has another frame
            time or particle radius than data sets have, its floor belongs to other scenes or is locked by another
            run, or the workers cannot do the work.
        SimulationError: the scheduler was lost; finished runs are there.
    """
    originals = readable_trajectories(data)
    folder = data.resolve() / FOLDER
    with open_worker_pool(workers, scheduler) as pool, lock_folder(folder) as token:
        runs = [(path, axis) for path in originals for axis in range(AXES)]
        missing = [(path, axis) for path, axis in runs if not is_finished(folder, path, axis)]
        pool.check_workers(folder, token)
        estimate = ProgressEstimate(len(runs) - len(missing), len(runs), progress)
        for job in pool.as_completed([pool.submit(simulate_shifted, path.resolve(), axis) for path, axis in missing]):
            estimate.step(job.result(), pool.slots)
    paths = [run_path(folder, *run) for run in runs]
    for path in paths:
        if not path.exists():
            warnings.warn(FloorWarning(f"{path}: {failure_path(path).read_text().strip()}"), stacklevel=2)
    return [path for path in paths if path.exists()]


def run_path(folder: Path, original: Path, axis: int) -> Path:
    """The trajectory in the floor's ``folder`` of ``original`` run again with its water moved along ``axis``."""
    return folder / f"{original.stem}-{axis + 1}.h5"


def failure_path(path: Path) -> Path:
    """The text file with the reason why the run ``path`` failed."""
    return path.with_suffix(".failed.txt")


def readable_trajectories(data: Path) -> list[Path]:
    """The readable trajectories in ``data``, with a warning for each unreadable one.

    Raises:
        InputError: there is none, or the floor cannot run the scene of one again.
    """
    readable = []
    for path in trajectory_files(data):
        try:
            trajectory = Trajectory(path)
        except InputError as error:
            warnings.warn(FloorWarning(f"{error}; it is left out"), stacklevel=2)
            continue
        with trajectory:
            check_repeatable(path, trajectory)
        readable.append(path)
    if not readable:
        raise InputError(f"{data}: has no trajectories that can be read")
    return readable


def check_repeatable(path: Path, trajectory: Trajectory) -> None:
    """Check that the floor can run a scene again.

    Raises:
        InputError: it continues another trajectory, or its frames are not those of the simulators.
    """
    if trajectory.scene.restart is not None:
        raise InputError(f"{path}: continues another trajectory (restart), so the floor cannot run it; move it away")
    check_simulator_frames(path, trajectory)


def is_finished(folder: Path, original: Path, axis: int) -> bool:
    """Whether the run of ``original`` along ``axis`` is in the floor's ``folder``.

    Raises:
        InputError: its file belongs to another scene, or was cut off.
    """
    path = run_path(folder, original, axis)
    if not path.exists():
        return False
    with Trajectory(path) as found, Trajectory(original) as reference:
        expected = shifted_scene(reference, axis).with_paths_relative_to(folder, original.parent)
        if found.scene.to_yaml() != expected.to_yaml() or len(found) != len(reference):
            raise InputError(f"{path}: is not {original.name} run again; move it away")
    return True


def shifted_scene(reference: Trajectory, axis: int) -> Scene:
    """The scene of ``reference`` with its water 1 mm further along ``axis``."""
    x, y, z = shift_along(reference.scene, axis).tolist()

    def shifted(entry: Fluid) -> Fluid:
        if entry.block is None:
            raise InputError(f"the floor shifts blocks of water, but the scene has a {entry.kind}")
        lower, upper = ((corner[0] + x, corner[1] + y, corner[2] + z) for corner in (entry.block.min, entry.block.max))
        return Fluid(block=Block(min=lower, max=upper, velocity=entry.block.velocity))

    fluid = [shifted(entry) for entry in reference.scene.fluid]
    taps = [
        tap.model_copy(update={"at": (tap.at[0] + x, tap.at[1] + y, tap.at[2] + z)}) for tap in reference.scene.taps
    ]
    return reference.scene.model_copy(update={"fluid": fluid, "taps": taps, "frames": len(reference)})


def shift_along(scene: Scene, axis: int) -> np.ndarray:
    """The shift (3,) along ``axis``, meters."""
    return scene.units.length * SHIFT * np.eye(3)[axis]


def shifted_particles(start: InitialParticles, shift: np.ndarray) -> InitialParticles:
    """The same particles, moved by ``shift`` (3,) in meters.

    The shifted scene itself could start with a particle more or less because of the solid, which would make the two
    runs incomparable.
    """
    return InitialParticles(
        [(block + shift).astype(np.float32) for block in start.block_positions],
        start.block_velocities,
        start.excluded,
        block_liquids=start.block_liquids,
    )


def simulate_shifted(original: Path, axis: int) -> float | None:
    """Simulate the scene of ``original`` with its water moved along ``axis``; write the trajectory or the failure.

    Returns:
        The duration in seconds; None if the file was there already, from a worker that was lost before it reported.
    """
    began = time.monotonic()
    target = run_path(original.parent / FOLDER, original, axis)
    if target.exists():
        return None
    with Trajectory(original) as reference:
        scene, solids = shifted_scene(reference, axis), build_solids(reference.scene)
        start = shifted_particles(reference.scene.initial_particles(solids.at_time(0.0)), shift_along(scene, axis))

    def write(simulation: CheckedSimulation) -> None:
        with (
            atomic_write(target) as path,
            TrajectoryWriter(
                path, simulation.scene, Provenance(solver.NAME), simulation.particles, original.parent
            ) as writer,
        ):
            for number, frame in enumerate(until_canceled(iter(simulation))):
                writer.append(
                    *with_ids(scene, *frame, simulation.solids.poses(number * scene.frame_time)), liquids=start.liquids
                )

    try:
        with_retry(CheckedSimulation(scene, solids, start), write)
        failure_path(target).unlink(missing_ok=True)
    except (UnphysicalError, solver.SolverError) as error:
        failure_path(target).write_text(f"{error}\n")
    return time.monotonic() - began
