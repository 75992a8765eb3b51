"""Positions and velocities over time, and the scene that they belong to, in an HDF5 file.

The layout is LagrangeBench's (a group a trajectory, ``position`` and ``particle_type``) plus ``velocity``.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import h5py
import numpy as np

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene

GROUP = "00000"
FRAMES_PER_CHUNK = 8
FLUID_TYPE = 0
SPARE_BYTES = 256 * 1024  # kept free on the disk for the file's own tables


@dataclass(frozen=True)
class Provenance:
    """Where a trajectory comes from.

    Attributes:
        model: name of the simulator that made it.
        seed: what its random choices started from.
        version: of surfsup.
    """

    model: str
    seed: int = 0
    version: str = __version__


class Trajectory:
    """A simulated scene, read from disk frame by frame as it is asked for.

    Attributes:
        scene: what was simulated.
        provenance: by what.
        positions: (frames, particles, 3) float32 in metres, an HDF5 data set that slices like an array.
        velocities: the same in m/s, at the end of each frame.
    """

    def __init__(self, path: Path) -> None:
        """Open the trajectory in the file ``path``.

        Raises:
            InputError: the file is missing, is not HDF5, or is not a trajectory.
        """
        if not path.is_file():
            raise InputError(f"{path}: there is no such trajectory file")
        try:
            self._file = h5py.File(path, "r")
        except OSError as error:
            raise InputError(not_a_trajectory(path, error)) from None
        try:
            self.positions, self.velocities = (self._frames_of(name) for name in ("position", "velocity"))
            if self.positions.shape != self.velocities.shape:
                raise ValueError(f"{self.positions.shape} positions, {self.velocities.shape} velocities")
            attributes = dict(self._file.attrs)
            self.scene = Scene.from_yaml(str(attributes["scene"]), f"{path} (scene)", path.parent)
            self.provenance = Provenance(str(attributes["model"]), int(attributes["seed"]), str(attributes["version"]))
        except BaseException as error:
            self._file.close()
            if isinstance(error, OSError | KeyError | TypeError | ValueError) and not isinstance(error, InputError):
                raise InputError(not_a_trajectory(path, error)) from None
            raise

    def _frames_of(self, name: str) -> h5py.Dataset:
        data = self._file[f"{GROUP}/{name}"]
        if not isinstance(data, h5py.Dataset) or data.ndim != 3 or data.shape[2] != 3:
            raise ValueError(f"{name} is not (frames, particles, 3)")
        return data

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.positions)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Trajectory:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class TrajectoryWriter:
    """Frames to disk as they are made, so that memory does not grow and what is done is never lost.

    Use as a context manager: leaving it, also by an error or an interrupt, leaves a readable file.
    """

    def __init__(self, path: Path, scene: Scene, provenance: Provenance, particles: int) -> None:
        """Create ``path`` for a trajectory of ``scene`` with that many particles.

        Raises:
            InputError: the file cannot be written.
        """
        self._path = path
        self._check_room(SPARE_BYTES)
        try:
            self._file = h5py.File(path, "w")
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else one_line(error)
            raise InputError(f"{path}: cannot be written ({reason})") from None
        self._file.attrs.update(
            {
                "scene": scene.with_absolute_files().to_yaml(),
                "frame_time": FRAME_TIME,
                "radius": PARTICLE_RADIUS,
                "model": provenance.model,
                "seed": provenance.seed,
                "version": provenance.version,
            }
        )
        group = self._file.create_group(GROUP)
        self._sets = [
            group.create_dataset(
                name,
                shape=(0, particles, 3),
                maxshape=(None, particles, 3),
                chunks=(FRAMES_PER_CHUNK, particles, 3),
                dtype=np.float32,
                shuffle=True,
                compression="gzip",
                compression_opts=1,
            )
            for name in ("position", "velocity")
        ]
        group["particle_type"] = np.full(particles, FLUID_TYPE, dtype=np.int64)
        self._particles = particles
        self._written = 0
        self._waiting: list[np.ndarray] = []

    def append(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Add one frame: positions (N, 3) in metres and velocities (N, 3) in m/s; both are copied.

        Raises:
            InputError: the disk is full.
            ValueError: a shape is not (N, 3).
        """
        frame = np.empty((2, self._particles, 3), dtype=np.float32)
        for kept, given in zip(frame, (positions, velocities), strict=True):
            if np.shape(given) != kept.shape:
                raise ValueError(f"a frame is of shape {np.shape(given)} instead of {kept.shape}")
            kept[:] = given
        self._waiting.append(frame)
        if len(self._waiting) == FRAMES_PER_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting. Interrupted it can be called again: it writes to the same place.

        Raises:
            InputError: the disk is full; the file holds the frames before.
        """
        if not self._waiting:
            return
        frames = np.stack(self._waiting, axis=1)
        # HDF5 cannot recover from a disk that fills up under it (closing the file crashes), so ask first.
        self._check_room(frames.nbytes + SPARE_BYTES)
        end = self._written + len(self._waiting)
        try:
            for data, values in zip(self._sets, frames, strict=True):
                data.resize(end, axis=0)
                data[self._written : end] = values
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._path}: cannot be written ({one_line(error)})") from None
        self._written = end
        self._waiting.clear()

    def _check_room(self, needed: int) -> None:
        try:
            free = shutil.disk_usage(self._path.parent).free
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written ({error.strerror})") from None
        if free < needed:
            raise InputError(f"{self._path}: cannot be written: the disk is full ({free / 1e6:.3g} MB are free)")

    def __enter__(self) -> TrajectoryWriter:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.flush()
        except InputError:
            if error is None:
                raise
        finally:
            self._file.close()


def not_a_trajectory(path: Path, error: Exception) -> str:
    """The complaint about a file that could not be read."""
    return f"{path}: is not a trajectory of surfsup, or was cut off ({one_line(error)})"


def one_line(error: Exception) -> str:
    """What the HDF5 library said, which may go over several lines."""
    return " ".join(str(error).split())
