"""The forces of a trajectory as a table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory import Trajectory

COLUMNS = ("time_s", "solid", "force_x_N", "force_y_N", "force_z_N", "torque_x_Nm", "torque_y_Nm", "torque_z_Nm")


def recorded_solids(trajectory: Trajectory, source: Path, names: Sequence[str] = ()) -> list[str]:
    """The solids whose forces a trajectory has: those of ``names``, or all.

    Args:
        trajectory: the trajectory.
        source: its file, for the message.
        names: of solids.

    Raises:
        InputError: it has none, or not those of a name.
    """
    known = list(trajectory.forces)
    if not known:
        raise InputError(f"{source}: has no forces; simulate the scene with the key 'forces: all'")
    if unknown := [name for name in names if name not in known]:
        raise InputError(f"{source}: has no forces on '{unknown[0]}'; it has those on {', '.join(known)}")
    return list(names) or known


def write_force_table(trajectory: Trajectory, names: Sequence[str], path: Path) -> None:
    """Write a CSV file with a row for each frame and solid. The first frame has no forces, so it is left out.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        with atomic_file(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            for frame in range(len(trajectory)):
                time = trajectory.start_time + frame * trajectory.frame_time
                for name in names:
                    row = np.concatenate([trajectory.forces[name][frame], trajectory.torques[name][frame]])
                    if not np.isnan(row).all():
                        writer.writerow([f"{time:.9g}", name, *(f"{value:.9g}" for value in row)])
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
