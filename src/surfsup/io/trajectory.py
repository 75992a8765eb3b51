"""Positions and velocities over time, and the scene that they belong to, in an HDF5 file.

The layout is LagrangeBench's (a group a trajectory, ``position`` and ``particle_type``) plus ``velocity``. Both are
stored through HDF5's own shuffle and deflate filters, so every HDF5 program reads them. The chunks are packed and
unpacked by ISA-L here, which writes eight times faster than HDF5 does.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import numpy as np
from isal import isal_zlib

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene

GROUP = "00000"
FRAMES_PER_CHUNK = 2  # more pack better (8: 0.66 instead of 0.72 of raw), but a window then reads frames in vain
FRAMES_PER_FLUSH = 8
PACKING = 2  # ISA-L's level
VELOCITY_STEP = 2.0**-16  # m/s: finer than positions tell it, which float32 keeps to 6e-8 m; the rest is noise to store
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


class TrajectoryFrames:
    """The frames of a simulated scene, read from disk one by one as they are asked for, whatever they are of.

    Attributes:
        positions: (frames, particles, 3) float32 in meters, an HDF5 data set that slices like an array.
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
            self._read(path)
        except BaseException as error:
            self._file.close()
            if isinstance(error, OSError | KeyError | TypeError | ValueError) and not isinstance(error, InputError):
                raise InputError(not_a_trajectory(path, error)) from None
            raise

    def _read(self, path: Path) -> None:
        self.positions, self.velocities = (self._frames_of(name) for name in ("position", "velocity"))
        if self.positions.shape != self.velocities.shape:
            raise ValueError(f"{self.positions.shape} positions, {self.velocities.shape} velocities")

    def _frames_of(self, name: str) -> h5py.Dataset:
        data = self._file[f"{GROUP}/{name}"]
        if not isinstance(data, h5py.Dataset) or data.ndim != 3 or data.shape[2] != 3:
            raise ValueError(f"{name} is not (frames, particles, 3)")
        return data

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.positions)

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) of ``count`` frames from ``first`` on, the fast way."""
        return read_chunks(self.positions, first, count), read_chunks(self.velocities, first, count)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class Trajectory(TrajectoryFrames):
    """A simulated scene: its frames, and what they are of.

    Attributes:
        scene: what was simulated.
        provenance: by what.
        frame_time: seconds from one frame to the next.
        radius: of a particle, meters.
    """

    def _read(self, path: Path) -> None:
        super()._read(path)
        attributes = dict(self._file.attrs)
        self.scene = Scene.from_yaml(str(attributes["scene"]), f"{path} (scene)", path.parent)
        self.frame_time, self.radius = float(attributes["frame_time"]), float(attributes["radius"])
        self.provenance = Provenance(str(attributes["model"]), int(attributes["seed"]), str(attributes["version"]))


class TrajectoryWriter:
    """Frames to disk as they are made, so that memory does not grow and what is done is never lost.

    Use as a context manager: leaving it, also by an error or an interrupt, leaves a readable file.
    """

    def __init__(
        self, path: Path, scene: Scene, provenance: Provenance, particles: int, within: Path | None = None
    ) -> None:
        """Create ``path`` for a trajectory of ``scene`` with that many particles.

        Args:
            path: of the file; one that is there is replaced.
            scene: that it is of.
            provenance: what makes it.
            particles: how many.
            within: the folder around it that may be moved as a whole, its own unless given.

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
                "scene": scene.with_files_from(path.parent, within).to_yaml(),
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
        # What waits to be written, and room to pack a chunk in: the same memory again and again stays in the cache.
        self._block = np.empty((2, FRAMES_PER_FLUSH, particles, 3), dtype=np.float32)
        self._shuffled = np.empty((4, FRAMES_PER_CHUNK * particles * 3), dtype=np.uint8)
        self._written = 0
        self._waiting = 0

    @property
    def frames(self) -> int:
        """How many there are, those that wait to be written among them."""
        return self._written + self._waiting

    def note(self, topic: str, values: Mapping[str, object]) -> None:
        """Keep ``values`` (numbers, texts, arrays) in the file as attributes of a group named ``topic``."""
        self._file.create_group(topic).attrs.update(values)

    def append(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Add one frame: positions (N, 3) in meters and velocities (N, 3) in m/s; both are copied.

        Raises:
            InputError: the disk is full.
            ValueError: a shape is not (N, 3).
        """
        frame = self._block[:, self._waiting]
        for kept, given in zip(frame, (positions, velocities), strict=True):
            if np.shape(given) != kept.shape:
                raise ValueError(f"a frame is of shape {np.shape(given)} instead of {kept.shape}")
            kept[:] = given
        frame[1] /= VELOCITY_STEP
        np.round(frame[1], out=frame[1])
        frame[1] *= VELOCITY_STEP
        self._waiting += 1
        if self._waiting == FRAMES_PER_FLUSH:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting. Interrupted it can be called again: it writes to the same place.

        Raises:
            InputError: the disk is full; the file holds the frames before.
        """
        if not self._waiting:
            return
        frames = self._block[:, : self._waiting]
        # HDF5 cannot recover from a disk that fills up under it (closing the file crashes), so ask first.
        self._check_room(frames.nbytes + SPARE_BYTES)
        try:
            for data, values in zip(self._sets, frames, strict=True):
                data.resize(self.frames, axis=0)
                write_chunks(data, self._written, values, self._shuffled)
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._path}: cannot be written ({one_line(error)})") from None
        # A block that is not full yet is written again with the frames that are to come.
        if self._waiting == FRAMES_PER_FLUSH:
            # Both at once, for an interrupt that comes between them would have frames counted twice.
            self._written, self._waiting = self.frames, 0

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


def write_chunks(data: h5py.Dataset, first: int, frames: np.ndarray, shuffled: np.ndarray) -> None:
    """Write ``frames`` (K, N, 3) float32 from place ``first`` on, which is where a chunk begins.

    Args:
        data: the data set in the file.
        first: its frame that the first of ``frames`` becomes.
        frames: where they are contiguous no copy of them is made.
        shuffled: (4, FRAMES_PER_CHUNK * N * 3) uint8, room to pack in.
    """
    for start in range(0, len(frames), FRAMES_PER_CHUNK):
        chunk = frames[start : start + FRAMES_PER_CHUNK]
        # HDF5's shuffle: the first bytes of all values, then the second ones, and so on; a chunk ends in zeros.
        bytes_of = np.ascontiguousarray(chunk).reshape(-1).view(np.uint8).reshape(-1, shuffled.shape[0]).T
        shuffled[:, : bytes_of.shape[1]] = bytes_of
        shuffled[:, bytes_of.shape[1] :] = 0
        data.id.write_direct_chunk((first + start, 0, 0), isal_zlib.compress(shuffled, PACKING))


def read_chunks(data: h5py.Dataset, first: int, count: int) -> np.ndarray:
    """Frames (count, N, 3) from ``first`` on, of a data set that :func:`write_chunks` wrote; else as HDF5 reads it."""
    length = data.chunks[0] if data.chunks else 0
    end = first + count
    fast = length and data.shuffle and data.compression == "gzip" and data.dtype == np.float32 and end <= len(data)
    if not fast or data.chunks[1:] != data.shape[1:]:
        return data[first:end]
    begin = first - first % length
    size = int(np.prod(data.chunks)) * data.dtype.itemsize
    chunks = []
    for start in range(begin, end, length):
        _, packed = data.id.read_direct_chunk((start, 0, 0))
        shuffled = np.frombuffer(isal_zlib.decompress(packed, bufsize=size), dtype=np.uint8)
        chunks.append(shuffled.reshape(data.dtype.itemsize, -1).T.copy().view(np.float32).reshape(data.chunks))
    return np.concatenate(chunks)[first - begin : end - begin] if chunks else data[first:end]


def not_a_trajectory(path: Path, error: Exception) -> str:
    """The complaint about a file that could not be read."""
    return f"{path}: is not a trajectory of surfsup, or was cut off ({one_line(error)})"


def one_line(error: Exception) -> str:
    """What the HDF5 library said, which may go over several lines."""
    return " ".join(str(error).split())
