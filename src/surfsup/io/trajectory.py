"""Trajectories in HDF5 files: positions and velocities over time, and the scene they belong to.

:mod:`~surfsup.io.trajectory_format` has the layout. Files may come from strangers: nothing is read but plain numbers
that are in the file itself, and what is damaged is an error of one line.
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import numpy as np

from surfsup.checked.hdf5 import check_written, stored_dataset, stored_object
from surfsup.checked.tensors import finite_number
from surfsup.errors import InputError, single_line
from surfsup.io.frame_chunks import DAMAGED, read_chunks
from surfsup.io.trajectory_format import FORCES, GROUP, LIFETIMES, POSES, TORQUES, Provenance
from surfsup.io.trajectory_path import existing_trajectory
from surfsup.scene import Scene
from surfsup.scene.particle_file import LIQUIDS, read_liquids
from surfsup.scene.restarted_bodies import BODIES

MAX_TIME = 1e7  # seconds, of a frame and of the start
UNREADABLE = (OSError, RuntimeError, KeyError, TypeError, ValueError)  # that h5py raises for files that are damaged


class TrajectoryFrames:
    """The frames of a trajectory file without its scene, read from disk on demand.

    A particle has the same column in all frames: its id. Where water enters or leaves, a particle has NaN in the frames
    in which it is not in the scene; :meth:`ids` says which are.

    Attributes:
        path: its file.
        positions: (frames, particles, 3) float32 in meters, an HDF5 data set that slices like an array.
        velocities: (frames, particles, 3) float32 in m/s, at the end of each frame.
        lifetimes: (particles, 2) int64, the first frame of each particle and the one after its last; None where all
            particles are in all frames.
        liquids: (particles,) int32, which of the scene's :attr:`~surfsup.Scene.mixture` each particle is; None in a
            scene of one liquid.
    """

    def __init__(self, path: str | Path) -> None:
        """Open the trajectory file ``path``, or the ``trajectory.h5`` in a folder.

        Raises:
            InputError: the file is missing, is not HDF5, or is not a trajectory.
        """
        self.path = path = existing_trajectory(path)
        try:
            self._file = self._open(path)
        except OSError as error:
            raise InputError(not_a_trajectory(path, error)) from None
        try:
            self._read(path)
        except BaseException as error:
            self._file.close()
            if isinstance(error, UNREADABLE) and not isinstance(error, InputError):
                raise InputError(not_a_trajectory(path, error)) from None
            raise

    def _open(self, path: Path) -> h5py.File:
        return h5py.File(path, "r")

    def _read(self, path: Path) -> None:
        self.positions, self.velocities = (self._frames_of(name) for name in ("position", "velocity"))
        if self.positions.shape != self.velocities.shape:
            raise ValueError(f"{self.positions.shape} positions, {self.velocities.shape} velocities")
        self.lifetimes = None
        if LIFETIMES in self._file:
            lifetimes = stored_dataset(self._file, LIFETIMES, "iu")
            check_written(lifetimes)
            self.lifetimes = lifetimes[:]
        if self.lifetimes is not None and self.lifetimes.shape != (self.positions.shape[1], 2):
            raise ValueError(f"{self.positions.shape} positions, {self.lifetimes.shape} lifetimes")
        self.liquids = read_liquids(self._file, self.positions.shape[1])[0] if LIQUIDS in self._file else None

    def _frames_of(self, name: str) -> h5py.Dataset:
        data = stored_dataset(self._file, f"{GROUP}/{name}")
        if data.ndim != 3 or data.shape[2] != 3:
            raise ValueError(f"{name} is not (frames, particles, 3)")
        self._check_written(data)
        return data

    def _check_written(self, data: h5py.Dataset) -> None:
        check_written(data)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.positions)

    def ids(self, frame: int) -> np.ndarray:
        """The ids (K,) int64, ascending, of the particles that are in the scene in a frame."""
        if self.lifetimes is None:
            return np.arange(self.positions.shape[1])
        first, end = self.lifetimes.T
        return np.flatnonzero((first <= frame) & (frame < end))

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) of ``count`` frames from ``first``; faster than slicing.

        Raises:
            OSError: the frames are damaged.
        """
        try:
            return read_chunks(self.positions, first, count), read_chunks(self.velocities, first, count)
        except DAMAGED as error:  # type: ignore[misc]  # the stub of isal declares an instance
            raise OSError(single_line(error)) from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()
        if isinstance(error, OSError) and error.errno is None:  # of HDF5, which does not say which file it is
            raise InputError(f"{self.path}: is damaged ({single_line(error)})") from None


class Trajectory(TrajectoryFrames):
    """A trajectory: frames and their scene.

    Attributes:
        scene: the simulated scene.
        provenance: simulator, seed and version.
        frame_time: seconds between frames.
        start_time: seconds, of the first frame; above 0 where the scene continues another trajectory, or was
            recorded after some steps.
        radius: particle radius in meters.
        forces: (frames, 3) float64 in N by name, of the fluid on the solids that the scene names, mean since the frame
            before; NaN in the first frame. Empty in a file without any.
        torques: (frames, 3) float64 in N m, likewise, about the origin of the solid.
        poses: (frames, 7) float64 by name, of every solid that moves, and of a container that moves: position x, y, z
            in meters and rotation, a unit quaternion w, x, y, z. Empty in a file without any.
        bodies: (frames, 12) float64 by name, of every rigid body: velocity of its center of mass, angular velocity,
            acceleration and angular acceleration by the fluid, in SI units.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=20)
        >>> sf.Simulation(scene).record("water.h5")
        >>> with sf.Trajectory("water.h5") as trajectory:
        ...     trajectory.positions.shape, trajectory.frame_time
        ((20, 125, 3), 0.005)
    """

    def _read(self, path: Path) -> None:
        super()._read(path)
        attributes = dict(self._file.attrs)
        self.scene = Scene.from_yaml(str(attributes["scene"]), f"{path} (scene)", path.parent)
        self.frame_time = finite_number("frame_time", float(attributes["frame_time"]), 1e-6, MAX_TIME)
        self.radius = finite_number("radius", float(attributes["radius"]), 1e-6, 1e3)
        self.start_time = finite_number("start_time", float(attributes.get("start_time", 0.0)), -MAX_TIME, MAX_TIME)
        self.provenance = Provenance(str(attributes["model"]), int(attributes["seed"]), str(attributes["version"]))
        self.poses = self._rows_by_name(POSES, 7)
        self.forces, self.torques = (self._rows_by_name(group, 3) for group in (FORCES, TORQUES))
        self.bodies = self._rows_by_name(BODIES, 12)

    def _rows_by_name(self, group: str, width: int) -> dict[str, np.ndarray]:
        """The rows (frames, width) of each solid in a group."""
        rows = {}
        for name in stored_object(self._file, group) if group in self._file else ():
            data = stored_dataset(self._file, f"{group}/{name}")
            if data.ndim != 2 or data.shape[1] != width or len(data) < len(self):
                raise ValueError(f"{group}/{name} is not (frames, {width})")
            check_written(data)
            rows[name] = data[: len(self)]
        return rows


def not_a_trajectory(path: Path, error: Exception) -> str:
    """The message about an unreadable file."""
    return f"{path}: is not a trajectory of surfsup, or was cut off ({single_line(error)})"
