"""A data set: many scenes of one recipe, simulated by the reference solver, one file each."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from surfsup.datasets.folder import locked, whole_file
from surfsup.datasets.generation import dataset_file
from surfsup.datasets.generation.checked_simulation import Run, simulate_sound
from surfsup.datasets.generation.dataset_file import Identity
from surfsup.datasets.generation.progress_estimate import Pace
from surfsup.datasets.generation.record import Made, note_making
from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.generation.worker_pool import crew, while_wanted
from surfsup.errors import InputError, SimulationError
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.splishsplash import solver


def generate(
    recipe: str,
    folder: Path,
    count: int,
    seed: int = 0,
    frames: int | None = None,
    source: Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int, float | None], None] | None = None,
) -> list[Path]:
    """Simulate ``count`` scenes of ``recipe`` into ``folder``; those already there are kept.

    Killed at any moment and called again it makes what is missing, the same to the byte as if undisturbed.

    Args:
        recipe: which scenes.
        folder: gets one trajectory file a scene and ``dataset.yaml``.
        count: how many scenes.
        seed: with the scene's number it decides everything about the scene.
        frames: of every scene; left out, as many as the recipe says.
        source: what the recipe makes surfaces of, where it takes that.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler whose workers do it instead; they see ``folder`` under the same path.
        progress: told how many of how many scenes are done, and the seconds left where they can be told.

    Returns:
        The trajectory files in order.

    Raises:
        InputError: no such recipe, nothing to make, the folder holds another data set or is being written to, or
            there are no workers that can do it.
        SimulationError: some scenes could not be made, or the scheduler was lost; all others are there.
    """
    if count < 1:
        raise InputError(f"asked for {count} scenes; there must be at least 1")
    folder = folder.resolve()
    drawing = Drawing(recipe, seed, frames, folder)
    identity = Identity.of(drawing, source)
    with crew(workers, scheduler) as doers, locked(folder) as token:
        dataset_file.check_identity(folder, identity)
        there = scenes_in(folder, drawing)
        doers.require(folder, token)
        drawing.prepare(source, count)
        dataset_file.describe(folder, identity, list(there.values()))
        pace = Pace(len(there.keys() & set(range(count))), count, progress)
        jobs = [doers.submit(make_scene, drawing, index) for index in range(count) if index not in there]
        failures = []
        for job in doers.finished(jobs):
            try:
                pace.step(job.result(), doers.slots)
            except SimulationError as error:
                failures.append(error)
        dataset_file.describe(folder, identity, list(scenes_in(folder, drawing).values()))
    if failures:
        others = f"; so it is with {len(failures) - 1} more" if len(failures) > 1 else ""
        raise SimulationError(f"{failures[0]}{others}; all other scenes are there")
    return [path_of(folder, index) for index in range(count)]


def path_of(folder: Path, index: int) -> Path:
    """Where scene ``index`` of a data set lies."""
    return folder / f"{index:05d}.h5"


def scenes_in(folder: Path, drawing: Drawing) -> dict[int, Made]:
    """The scenes that ``folder`` holds, by their numbers, in order.

    Raises:
        InputError: a trajectory was cut off, or is not of this data set.
    """
    there = {}
    for path in sorted(folder.glob("*.h5")):
        made = Made.read(path)
        if (made.recipe, made.seed, path_of(folder, made.index)) != (drawing.recipe, drawing.seed, path):
            raise InputError(
                f"{path}: is scene {made.index} of recipe '{made.recipe}', seed {made.seed}, and so is not of this "
                "data set; move it away"
            )
        there[made.index] = made
    return there


def make_scene(drawing: Drawing, index: int) -> float | None:
    """Simulate scene ``index`` into its file, which appears only when it is whole and sound.

    Returns:
        The seconds that it took; None if it was there already, made by a worker that was lost before it could say so.
    """
    if path_of(drawing.folder, index).exists():
        return None
    began = time.monotonic()

    def write(run: Run) -> None:
        provenance = Provenance(solver.NAME, drawing.seed)
        with (
            whole_file(path_of(drawing.folder, index)) as path,
            TrajectoryWriter(path, run.scene, provenance, run.particles) as writer,
        ):
            for positions, velocities in while_wanted(iter(run)):
                writer.append(positions, velocities)
            note_making(writer, drawing, index, run)

    simulate_sound(drawing, index, write)
    return time.monotonic() - began
