"""What a trajectory file of a data set says of its own making."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import h5py

from surfsup.datasets.generation.checked_simulation import Run
from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.generation.statistics import Sums
from surfsup.errors import InputError
from surfsup.io.trajectory import GROUP, TrajectoryWriter

TOPIC = "data_set"


@dataclass(frozen=True)
class Made:
    """How one scene of a data set was made.

    Attributes:
        recipe: that drew it.
        seed: of the data set.
        index: of the scene in it.
        set_aside: why the scenes drawn before it were not taken, one line each.
        solver: name of the simulator.
        version: of surfsup.
        frames: how many.
        particles: how many.
        sums: over its frames, for the statistics of the data set.
    """

    recipe: str
    seed: int
    index: int
    set_aside: list[str]
    solver: str
    version: str
    frames: int
    particles: int
    sums: Sums

    @classmethod
    def read(cls, path: Path) -> Made:
        """Read it from the trajectory file ``path``, which takes 2 ms.

        Raises:
            InputError: the file is cut off, or was not made by ``surfsup generate``.
        """
        try:
            with h5py.File(path, "r") as file:
                about, notes = file.attrs, dict(file[TOPIC].attrs)
                frames, particles, _ = file[f"{GROUP}/position"].shape
                return cls(
                    str(notes["recipe"]),
                    int(notes["seed"]),
                    int(notes["index"]),
                    str(notes["set_aside"]).splitlines(),
                    str(about["model"]),
                    str(about["version"]),
                    int(frames),
                    int(particles),
                    Sums.from_notes(notes),
                )
        except (OSError, KeyError, TypeError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise InputError(
                f"{path}: was cut off, or not made by 'surfsup generate' ({reason}); move it away"
            ) from None


def note_making(writer: TrajectoryWriter, drawing: Drawing, index: int, run: Run) -> None:
    """Write into a trajectory file what :meth:`Made.read` reads, once ``run`` has ended."""
    notes = {"recipe": drawing.recipe, "seed": drawing.seed, "index": index, "set_aside": "\n".join(run.set_aside)}
    writer.write_attributes(TOPIC, notes | run.sums.to_notes())
