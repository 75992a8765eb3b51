"""A whole sweep: cases, workers, table."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from surfsup import __version__
from surfsup.datasets.folder import atomic_write, lock_folder
from surfsup.datasets.generation.worker_pool import WorkerPool, open_worker_pool, until_canceled
from surfsup.errors import InputError, SimulationError
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import Scene
from surfsup.sweep.case import Case, cases_of
from surfsup.sweep.simulate_case import RESULT, simulate_case
from surfsup.sweep.table import Row, rows_of, write_table
from surfsup.sweep.variation import Variation

IDENTITY = "sweep.json"


@dataclass(frozen=True)
class Sweep:
    """A finished sweep.

    Attributes:
        folder: with a folder for each case, the table and the list of cases.
        cases: all cases in order.
        rows: of the table: the name of the case, the varied values and the figures of its simulation, or its error.
        tables: the files of the table.
    """

    folder: Path
    cases: list[Case]
    rows: list[Row]
    tables: list[Path]

    @property
    def finished(self) -> list[Case]:
        """The cases that have a trajectory."""
        return [case for case in self.cases if (self.folder / case.name / RESULT).exists()]

    @property
    def errors(self) -> dict[str, str]:
        """The messages of the cases that failed, by name."""
        return {row["case"]: row["error"] for row in self.rows if row.get("error")}


def sweep(
    scenes: Mapping[str, Scene],
    vary: Sequence[Variation] | Mapping[str, Sequence[float | int | str]],
    folder: str | Path,
    simulator: str = DEFAULT_SIMULATOR,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Sweep:
    """Simulate every scene with every combination of the varied values; cases that are finished are kept.

    After a kill at any moment another call simulates the missing cases.

    Args:
        scenes: by name; the names become those of the cases.
        vary: the values by key of the scene file, such as ``{"gravity.2": [-9.81, -1.62]}``.
        folder: gets a folder for each case, with its trajectory and summary, and ``table.csv``.
        simulator: its name, or a weights file.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler to use instead; its workers must share ``folder`` under the same path.
        progress: called with the numbers of finished and of all cases.

    Raises:
        InputError: a key or value is invalid, or the folder holds another sweep or is locked by another run.
        SimulationError: the scheduler was lost; finished cases are kept.

    Examples:
        >>> import surfsup as sf
        >>> from surfsup.sweep import sweep
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=5)
        >>> done = sweep({"drop": scene}, {"gravity.2": [-9.81, -1.62]}, "out/gravity")
        >>> [row["gravity.2"] for row in done.rows]
        [-9.81, -1.62]
    """
    variations = [Variation(key, tuple(values)) for key, values in vary.items()] if isinstance(vary, Mapping) else vary
    folder, cases = Path(folder).resolve(), cases_of(scenes, variations)
    simulator = simulator if not Path(simulator).is_file() else str(Path(simulator).resolve())
    load_simulator(simulator)  # refuse an unknown one before the first worker starts
    with open_worker_pool(workers, scheduler) as pool, lock_folder(folder) as token:
        check_identity(folder, simulator, cases)
        pool.check_workers(folder, token, [])
        errors = simulate_missing(pool, folder, simulator, cases, progress)
        rows = rows_of(folder, cases, errors)
        return Sweep(folder, cases, rows, write_table(folder, rows))


def simulate_missing(
    pool: WorkerPool, folder: Path, simulator: str, cases: Sequence[Case], progress: Callable[[int, int], None]
) -> dict[str, str]:
    """Simulate the cases that are not in the folder; returns the messages of those that failed."""
    missing = [case for case in cases if not (folder / case.name / RESULT).exists()]
    jobs = {pool.submit(simulate_case, case, folder, simulator, until_canceled): case.name for case in missing}
    done, errors = len(cases) - len(missing), {}
    progress(done, len(cases))
    for job in pool.as_completed(list(jobs)):
        try:
            job.result()
        except (InputError, SimulationError) as error:
            errors[jobs[job]] = str(error)
        done += 1
        progress(done, len(cases))
    return errors


def check_identity(folder: Path, simulator: str, cases: Sequence[Case]) -> None:
    """Write which cases the folder is for, or compare with what it says.

    Raises:
        InputError: it is for others.
    """
    file = folder / IDENTITY
    identity = {"version": __version__, "simulator": simulator, "cases": {case.name: case.digest for case in cases}}
    if not file.exists():
        with atomic_write(file) as partial:
            partial.write_text(json.dumps(identity, indent=2) + "\n")
        return
    try:
        found = json.loads(file.read_text())
        differing = [name for name in ("simulator", "cases") if found[name] != identity[name]]
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{file}: is damaged; give another folder with -o, or remove it") from None
    if differing:
        kind = "of another simulator" if differing[0] == "simulator" else "of other scenes or values"
        raise InputError(f"{folder}: holds a sweep {kind}; give another folder with -o")
