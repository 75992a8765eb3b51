"""The record of its own generation in each trajectory file of a data set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import h5py

from surfsup.checked.hdf5 import stored_dataset, stored_object
from surfsup.datasets.generation.checked_simulation import CheckedSimulation
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.generation.statistics import Moments
from surfsup.errors import InputError, single_line
from surfsup.io.trajectory_format import GROUP
from surfsup.io.trajectory_writer import TrajectoryWriter

RECORD_GROUP = "data_set"
REJECTIONS = "set_aside"  # the attribute's name in files since version 0.1


@dataclass(frozen=True)
class GenerationRecord:
    """How one scene of a data set was generated.

    Attributes:
        recipe: name of the recipe.
        seed: of the data set.
        index: of the scene in the data set.
        rejections: reasons why earlier scenes of this index were rejected, one line each.
        solver: name of the simulator.
        version: of surfsup.
        frames: number of frames.
        particles: number of particles.
        moments: over the frames, for the statistics of the data set.
    """

    recipe: str
    seed: int
    index: int
    rejections: list[str]
    solver: str
    version: str
    frames: int
    particles: int
    moments: Moments

    @classmethod
    def read(cls, path: Path) -> GenerationRecord:
        """Read the record in the trajectory file ``path``, which takes 2 ms.

        Raises:
            InputError: the file is cut off, or was not made by ``surfsup generate``.
        """
        if not path.is_file():
            raise InputError(f"{path}: is no plain file; move it away")
        try:
            with h5py.File(path, "r") as file:
                provenance, attributes = file.attrs, dict(stored_object(file, RECORD_GROUP).attrs)
                frames, particles, _ = stored_dataset(file, f"{GROUP}/position").shape
                return cls(
                    str(attributes["recipe"]),
                    int(attributes["seed"]),
                    int(attributes["index"]),
                    str(attributes[REJECTIONS]).splitlines(),
                    str(provenance["model"]),
                    str(provenance["version"]),
                    int(frames),
                    int(particles),
                    Moments.from_attributes(attributes),
                )
        except (OSError, RuntimeError, KeyError, TypeError, ValueError, OverflowError) as error:
            reason = single_line(error)
            raise InputError(
                f"{path}: was cut off, or not made by 'surfsup generate' ({reason}); move it away"
            ) from None


def write_record(writer: TrajectoryWriter, sampler: SceneSampler, index: int, simulation: CheckedSimulation) -> None:
    """Write the record of a finished ``simulation`` into its trajectory file."""
    attributes = {
        "recipe": sampler.recipe,
        "seed": sampler.seed,
        "index": index,
        REJECTIONS: "\n".join(simulation.rejections),
    }
    writer.write_attributes(RECORD_GROUP, attributes | simulation.moments.to_attributes())
