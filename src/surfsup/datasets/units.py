"""The frame time and the particle radius of all data sets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS


class UnitMismatchError(InputError):
    """A trajectory is intact, but has another frame time or particle radius."""


def check_units(path: Path, trajectory: Trajectory) -> None:
    """Check that a trajectory has the frame time and the particle radius of the simulators.

    Raises:
        UnitMismatchError: it has others.
    """
    if not np.allclose([trajectory.frame_time, trajectory.radius], [FRAME_TIME, PARTICLE_RADIUS], rtol=1e-6):
        raise UnitMismatchError(
            f"{path}: has a frame every {trajectory.frame_time:g} s and particles of radius {trajectory.radius:g} m; "
            f"the simulators here are for {FRAME_TIME:g} s and {PARTICLE_RADIUS:g} m, so take other data"
        )


def check_simulator_frames(path: Path, trajectory: Trajectory) -> None:
    """Check that every step of the simulators is a frame of a trajectory, whose particles may have any size.

    Raises:
        UnitMismatchError: it has other frames.
    """
    expected = trajectory.scene.units
    if not np.allclose([trajectory.frame_time, trajectory.radius], [expected.frame_time, expected.radius], rtol=1e-6):
        raise UnitMismatchError(
            f"{path}: has a frame every {trajectory.frame_time:.6g} s and particles of radius {trajectory.radius:g} m; "
            f"its scene needs {expected.frame_time:.6g} s and {expected.radius:g} m, so take other data, or generate "
            "it without fps"
        )


def check_same_units(paths: Sequence[Path], trajectories: Sequence[Trajectory]) -> None:
    """Check that trajectories have the same frame time and the same particle radius.

    Raises:
        UnitMismatchError: they have not, or one of them is not above zero.
    """
    first = trajectories[0]
    for path, other in zip(paths, trajectories, strict=True):
        units = [other.frame_time, other.radius]
        if not (min(units) > 0 and np.allclose(units, [first.frame_time, first.radius], rtol=1e-6)):
            raise UnitMismatchError(
                f"{path}: has a frame every {other.frame_time:.6g} s and particles of radius {other.radius:g} m, but "
                f"{paths[0]} {first.frame_time:.6g} s and {first.radius:g} m; simulate both with the same fps and "
                "particle_radius"
            )
