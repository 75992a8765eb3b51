"""Where the rigid bodies of a trajectory are at its end, and how they move."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.checked.hdf5 import stored_dataset
from surfsup.errors import InputError, single_line
from surfsup.scene.pose import Pose

if TYPE_CHECKING:
    from surfsup.scene.scene import Scene

POSES = "00000/pose"  # group with a data set (frames, 7) for each solid that moves
# Group with a data set (frames, 12) for each rigid body: velocity of the center of mass in m/s, angular velocity in
# rad/s, and the acceleration and the angular acceleration by the fluid, m/s² and rad/s².
BODIES = "00000/body"


def restarted_body(scene: Scene, name: str) -> tuple[Pose, np.ndarray] | None:
    """The pose and the motion (12,) of a rigid body in the last frame of the trajectory that ``scene`` continues.

    Returns:
        None if the scene continues none.

    Raises:
        InputError: the file is no such trajectory, or does not hold them.
    """
    if scene.restart is None:
        return None
    import h5py

    path: Path = scene.base_folder / scene.restart
    try:
        with h5py.File(path, "r") as file:
            if f"{BODIES}/{name}" not in file:
                raise InputError(
                    f"{path}: does not hold the velocity of the rigid body '{name}', which a scene that continues it "
                    "needs; omit restart"
                )
            pose, motion = (stored_dataset(file, f"{group}/{name}")[-1] for group in (POSES, BODIES))
    except (OSError, RuntimeError, KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"{path}: cannot be continued ({single_line(error)[:200]})") from None
    if pose.shape != (7,) or motion.shape != (12,) or not np.isfinite(motion).all():
        raise InputError(f"{path}: cannot be continued (the motion of '{name}' is not twelve finite numbers)")
    return Pose.from_array(pose), motion
