"""Generates a data set: many scenes of one recipe, simulated by the reference solver, one file each."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from surfsup.datasets.folder import atomic_write, lock_folder
from surfsup.datasets.generation.checked_simulation import CheckedSimulation, simulate_valid_scene
from surfsup.datasets.generation.dataset_file import DatasetIdentity, check_identity, write_dataset_file
from surfsup.datasets.generation.progress_estimate import ProgressEstimate
from surfsup.datasets.generation.record import GenerationRecord, write_record
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.generation.worker_pool import open_worker_pool, until_canceled
from surfsup.errors import InputError, SimulationError
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.splishsplash import solver
from surfsup.splishsplash.entering_water import with_ids


def generate(
    recipe: str,
    folder: str | Path,
    count: int,
    seed: int = 0,
    frames: int | None = None,
    source: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int, float | None], None] | None = None,
) -> list[Path]:
    """Simulate ``count`` scenes of ``recipe`` into ``folder``; scenes that are there already are kept.

    After a kill at any moment, another call makes the missing scenes, equal to the byte.

    Args:
        recipe: name of the recipe.
        folder: gets one trajectory file for each scene, and ``dataset.yaml``.
        count: number of scenes.
        seed: determines each scene, together with the scene's index.
        frames: number of frames of every scene; the recipe's own by default.
        source: file or folder for the recipe's surfaces, if it takes one.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler to use instead; its workers must share ``folder`` under the same path.
        progress: called with the numbers of finished and of all scenes, and the remaining seconds, None if unknown.

    Returns:
        The trajectory files in order.

    Raises:
        InputError: an argument is invalid, the folder holds another data set or is locked by another run, or the
            workers cannot do the work.
        SimulationError: some scenes could not be simulated, or the scheduler was lost; all other scenes are there.
    """
    if count < 1:
        raise InputError(f"the number of scenes is {count}, but must be at least 1")
    folder, source = Path(folder).resolve(), None if source is None else Path(source)
    if source is not None and not source.exists():
        raise InputError(f"--source {source}: does not exist")
    sampler = SceneSampler(recipe, seed, frames, folder)
    identity = DatasetIdentity.of(sampler, source)
    with open_worker_pool(workers, scheduler) as pool, lock_folder(folder) as token:
        check_identity(folder, identity)
        records = read_records(folder, sampler)
        pool.check_workers(folder, token)
        sampler.prepare(source, count)
        write_dataset_file(folder, identity, list(records.values()))
        estimate = ProgressEstimate(len(records.keys() & set(range(count))), count, progress)
        jobs = [pool.submit(simulate_to_file, sampler, index) for index in range(count) if index not in records]
        failures = []
        for job in pool.as_completed(jobs):
            try:
                estimate.step(job.result(), pool.slots)
            except SimulationError as error:
                failures.append(error)
        write_dataset_file(folder, identity, list(read_records(folder, sampler).values()))
    if failures:
        others = f", and {len(failures) - 1} more scenes failed" if len(failures) > 1 else ""
        raise SimulationError(f"{failures[0]}{others}; all other scenes are there")
    return [scene_path(folder, index) for index in range(count)]


def scene_path(folder: Path, index: int) -> Path:
    """The trajectory file of scene ``index`` of a data set."""
    return folder / f"{index:05d}.h5"


def read_records(folder: Path, sampler: SceneSampler) -> dict[int, GenerationRecord]:
    """The records of the scenes in ``folder`` by index, in order.

    Raises:
        InputError: a trajectory is cut off, or belongs to another data set.
    """
    records = {}
    for path in sorted(folder.glob("*.h5")):
        record = GenerationRecord.read(path)
        if (record.recipe, record.seed, scene_path(folder, record.index)) != (sampler.recipe, sampler.seed, path):
            raise InputError(
                f"{path}: is scene {record.index} of recipe '{record.recipe}', seed {record.seed}, and so is not of "
                "this data set; move it away"
            )
        records[record.index] = record
    return records


def simulate_to_file(sampler: SceneSampler, index: int) -> float | None:
    """Simulate scene ``index`` into its file, which appears only when it is complete and physical.

    Returns:
        The duration in seconds; None if the file was there already, from a worker that was lost before it reported.
    """
    if scene_path(sampler.folder, index).exists():
        return None
    start = time.monotonic()

    def write(simulation: CheckedSimulation) -> None:
        provenance = Provenance(solver.NAME, sampler.seed)
        with (
            atomic_write(scene_path(sampler.folder, index)) as path,
            TrajectoryWriter(path, simulation.scene, provenance, simulation.particles) as writer,
        ):
            for number, frame in enumerate(until_canceled(iter(simulation))):
                writer.append(
                    *with_ids(simulation.scene, *frame, simulation.solids.poses(number * simulation.scene.frame_time))
                )
            write_record(writer, sampler, index, simulation)

    simulate_valid_scene(sampler, index, write)
    return time.monotonic() - start
