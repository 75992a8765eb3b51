"""The floor: the reference run again from starts moved by a millimeter, against which no model can be told to fail."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from surfsup.datasets.folder import locked, whole_file
from surfsup.datasets.generation.checked_simulation import Run, patiently
from surfsup.datasets.generation.physical_check import UnphysicalError
from surfsup.datasets.generation.progress_estimate import Pace
from surfsup.datasets.generation.worker_pool import crew, while_wanted
from surfsup.errors import InputError
from surfsup.io.trajectory import Provenance, Trajectory, TrajectoryWriter
from surfsup.scene import Block, Fluid, InitialParticles, Scene
from surfsup.splishsplash import solver

FOLDER = "floor"
STEP = 0.001  # meters
AXES = 3  # the start is moved along x, y and z in turn


class NoFloorWarning(UserWarning):
    """A trajectory cannot be read, or its scene cannot be run again."""


def floor(
    data: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int, float | None], None] | None = None,
) -> list[Path]:
    """Run the reference again, three times, for each trajectory in ``data``; what is there already is kept.

    The water of run 1 starts 1 mm further along x, that of run 2 along y, of run 3 along z. The trajectories are
    ``floor/NAME-1.h5`` to ``floor/NAME-3.h5`` in ``data``, of as many frames as the original. Why one could not be
    made stands in ``floor/NAME-1.failed.txt``.

    Args:
        data: folder of trajectories by the reference solver.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler whose workers do it instead; they see ``data`` under the same path.
        progress: told how many of how many runs are done, and the seconds left where they can be told.

    Returns:
        The trajectories of the floor that are there.

    Raises:
        InputError: the folder has no trajectory that can be read, its floor is of other scenes or is being written
            to, or there are no workers that can do it.
        SimulationError: the scheduler was lost; what was finished is there.
    """
    originals = readable_trajectories(data)
    home = data.resolve() / FOLDER
    with crew(workers, scheduler) as doers, locked(home) as token:
        runs = [(path, axis) for path in originals for axis in range(AXES)]
        missing = [(path, axis) for path, axis in runs if not is_there(home, path, axis)]
        doers.require(home, token)
        pace = Pace(len(runs) - len(missing), len(runs), progress)
        for job in doers.finished([doers.submit(run_again, path.resolve(), axis) for path, axis in missing]):
            pace.step(job.result(), doers.slots)
    made = [path_of(home, *run) for run in runs]
    for path in made:
        if not path.exists():
            warnings.warn(NoFloorWarning(f"{path}: {complaint_of(path).read_text().strip()}"), stacklevel=2)
    return [path for path in made if path.exists()]


def path_of(home: Path, original: Path, axis: int) -> Path:
    """Where the run of ``original`` moved along ``axis`` lies in the floor's folder ``home``."""
    return home / f"{original.stem}-{axis + 1}.h5"


def complaint_of(path: Path) -> Path:
    """Where it stands why the run ``path`` could not be made."""
    return path.with_suffix(".failed.txt")


def readable_trajectories(data: Path) -> list[Path]:
    """The trajectories of ``data``, warned of those that cannot be read.

    Raises:
        InputError: there is none.
    """
    readable = []
    for path in sorted(data.glob("*.h5")):
        try:
            Trajectory(path).close()
        except InputError as error:
            warnings.warn(NoFloorWarning(f"{error}; it is left out"), stacklevel=2)
        else:
            readable.append(path)
    if not readable:
        raise InputError(f"{data}: has no trajectories (*.h5); make some with 'surfsup generate'")
    return readable


def is_there(home: Path, original: Path, axis: int) -> bool:
    """Whether that run was made.

    Raises:
        InputError: a file of its name is of another scene, or was cut off.
    """
    path = path_of(home, original, axis)
    if not path.exists():
        return False
    with Trajectory(path) as found, Trajectory(original) as truth:
        wanted = moved_scene(truth, axis).with_paths_relative_to(home, original.parent)
        if found.scene.to_yaml() != wanted.to_yaml() or len(found) != len(truth):
            raise InputError(f"{path}: is not {original.name} run again; move it away")
    return True


def moved_scene(truth: Trajectory, axis: int) -> Scene:
    """The scene of ``truth`` with its water 1 mm further along ``axis``."""
    shift = STEP * np.eye(3)[axis]

    def moved(entry: Fluid) -> Fluid:
        lower, upper = (tuple((np.array(corner) + shift).tolist()) for corner in (entry.block.min, entry.block.max))
        return Fluid(block=Block(min=lower, max=upper, velocity=entry.block.velocity))

    return truth.scene.model_copy(update={"fluid": [moved(entry) for entry in truth.scene.fluid], "frames": len(truth)})


def moved_start(start: InitialParticles, axis: int) -> InitialParticles:
    """The same particles, 1 mm further along ``axis``; not those that the moved scene would start with.

    A particle more or less, because of the solid, would make the two runs impossible to compare.
    """
    shift = STEP * np.eye(3)[axis]
    return InitialParticles(
        [(block + shift).astype(np.float32) for block in start.block_positions], start.block_velocities, start.excluded
    )


def run_again(original: Path, axis: int) -> float | None:
    """Simulate the scene of ``original`` moved along ``axis`` into its file, or say beside it why that failed.

    Returns:
        The seconds that it took; None if it was there already, made by a worker that was lost before it could say so.
    """
    began = time.monotonic()
    target = path_of(original.parent / FOLDER, original, axis)
    if target.exists():
        return None
    with Trajectory(original) as truth:
        scene, surface = moved_scene(truth, axis), truth.scene.build_surface()
        start = moved_start(truth.scene.initial_particles(surface), axis)

    def write(run: Run) -> None:
        with (
            whole_file(target) as path,
            TrajectoryWriter(path, run.scene, Provenance(solver.NAME), run.particles, original.parent) as writer,
        ):
            for positions, velocities in while_wanted(iter(run)):
                writer.append(positions, velocities)

    try:
        patiently(Run(scene, surface, start), write)
        complaint_of(target).unlink(missing_ok=True)
    except (UnphysicalError, solver.SolverError) as error:
        complaint_of(target).write_text(f"{error}\n")
    return time.monotonic() - began
