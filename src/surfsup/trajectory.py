"""Positions and velocities over time, and the scene that they belong to, in an HDF5 file.

The layout is LagrangeBench's (a group a trajectory, ``position`` and ``particle_type``) plus ``velocity``.
"""

from __future__ import annotations

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
            group = self._file[GROUP]
            self.positions, self.velocities = group["position"], group["velocity"]
            attributes = dict(self._file.attrs)
            self.scene = Scene.from_yaml(str(attributes["scene"]), f"{path} (scene)", path.parent)
            self.provenance = Provenance(
                str(attributes["model"]), int(attributes["seed"]), str(attributes["version"])
            )
        except (OSError, KeyError) as error:
            raise InputError(f"{path}: is not a trajectory of surfsup, or was cut off ({error})") from None

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
        try:
            self._file = h5py.File(path, "w")
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
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
        self._waiting: list[tuple[np.ndarray, np.ndarray]] = []

    def append(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Add one frame: positions (N, 3) in metres and velocities (N, 3) in m/s."""
        self._waiting.append((positions, velocities))
        if len(self._waiting) == FRAMES_PER_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting.

        Raises:
            InputError: the disk is full.
        """
        if not self._waiting:
            return
        try:
            for data, frames in zip(self._sets, zip(*self._waiting, strict=True), strict=True):
                data.resize(len(data) + len(frames), axis=0)
                data[-len(frames) :] = np.stack(frames)
            self._file.flush()
        except OSError as error:
            raise InputError(f"{self._file.filename}: cannot be written: {error}") from None
        self._waiting.clear()

    def __enter__(self) -> TrajectoryWriter:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.flush()
        self._file.close()
