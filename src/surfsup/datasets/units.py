"""The frame time and the particle radius that everything here is made for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS


class OtherUnits(InputError):
    """A trajectory is sound, but of another frame time or particle radius."""


def check_units(path: Path, trajectory: Trajectory) -> None:
    """Refuse what no simulator here could learn from or be judged by.

    Raises:
        OtherUnits: the trajectory is of another frame time or particle radius than the simulators'.
    """
    if not np.allclose([trajectory.frame_time, trajectory.radius], [FRAME_TIME, PARTICLE_RADIUS], rtol=1e-6):
        raise OtherUnits(
            f"{path}: has a frame every {trajectory.frame_time:g} s and particles of radius {trajectory.radius:g} m; "
            f"the simulators here are for {FRAME_TIME:g} s and {PARTICLE_RADIUS:g} m, so take other data"
        )
