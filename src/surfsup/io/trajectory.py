"""Trajectories in HDF5 files: positions and velocities over time, and the scene they belong to.

The layout is that of LagrangeBench (one group per trajectory with ``position`` and ``particle_type``) plus
``velocity``. Both use HDF5's own shuffle and deflate filters, so every HDF5 program reads them. This module compresses
and decompresses the chunks with ISA-L, which writes eight times faster than HDF5.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import numpy as np
from isal import isal_zlib
from isal.igzip_lib import IsalError

from surfsup import __version__
from surfsup.checked.hdf5 import check_written, stored_dataset, stored_object
from surfsup.checked.tensors import finite_number
from surfsup.errors import InputError
from surfsup.io.reserved_space import ReservedSpace
from surfsup.scene import Scene
from surfsup.scene.particle_file import LIQUIDS, read_liquids
from surfsup.scene.pose import Pose
from surfsup.scene.restarted_bodies import BODIES
from surfsup.scene.wrench import Wrench

GROUP = "00000"
POSES = (
    f"{GROUP}/pose"  # group with a data set (frames, 7) for each solid that moves: x, y, z in meters, then w, x, y, z
)
LIFETIMES = (
    f"{GROUP}/lifetime"  # data set (particles, 2) where water enters or leaves: first frame, frame after the last
)
# Groups with a data set (frames, 3) for each solid whose force is recorded: N, and N m about the solid's origin. NaN in
# the first frame, which has none.
WRENCHES = (f"{GROUP}/forces", f"{GROUP}/torques")
FRAMES_PER_CHUNK = 2  # larger chunks compress better (8: 0.66 instead of 0.72), but windows then read unused frames
FRAMES_PER_FLUSH = 8
COMPRESSION_LEVEL = 2  # of ISA-L
# Velocities are rounded to multiples of this, in m/s. It is finer than the velocities that positions resolve, which
# float32 stores to 6e-8 m; finer digits are noise that does not compress.
VELOCITY_STEP = 2.0**-16
FLUID_TYPE = 0
MAX_TIME = 1e7  # seconds, of a frame and of the start
UNREADABLE = (OSError, RuntimeError, KeyError, TypeError, ValueError)  # that h5py raises for files that are damaged
DAMAGED = (OSError, RuntimeError, ValueError, IsalError)  # that reading chunks raises
SPARE_BYTES = 256 * 1024  # free disk space for the tables of the file


@dataclass(frozen=True)
class Provenance:
    """Where a trajectory comes from.

    Attributes:
        simulator: name of the simulator.
        seed: seed of its random numbers.
        version: version of surfsup.
    """

    simulator: str
    seed: int = 0
    version: str = __version__


def trajectory_path(path: str | Path) -> Path:
    """The trajectory file of ``path``: itself, or the ``trajectory.h5`` in it if it is a folder with one."""
    inside = Path(path) / "trajectory.h5"
    return inside if inside.is_file() else Path(path)


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
        self.path = path = trajectory_path(path)
        if not path.is_file():
            missing = "has no trajectory.h5" if path.is_dir() else "there is no such trajectory file"
            raise InputError(f"{path}: {missing}")
        try:
            self._file = self._open(path)
        except OSError as error:
            raise InputError(not_a_trajectory(path, error)) from None
        try:
            self._read(path)
        except BaseException as error:
            self._file.close()
            if isinstance(error, OSError | RuntimeError | KeyError | TypeError | ValueError) and not isinstance(
                error, InputError
            ):
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
        self.forces, self.torques = (self._rows_by_name(group, 3) for group in WRENCHES)
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


class TrajectoryWriter:
    """Writes frames to disk during a simulation, in constant memory.

    Use as a context manager. The file is readable afterwards, also after an error or an interrupt; then its frames are
    beside a file that they were to replace, at :attr:`path`.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        provenance: Provenance,
        particles: int,
        root: Path | None = None,
        start_time: float | None = None,
    ) -> None:
        """Create the file ``path``, or replace it.

        Args:
            path: the new file.
            scene: the simulated scene.
            provenance: simulator, seed and version.
            particles: number of particles; where water enters, of all that ever will.
            root: folder that may be moved as a whole; that of ``path`` by default. Paths inside it are written
                relative to the file.
            start_time: seconds, of the first frame; by default that of the scene.

        Raises:
            InputError: the file cannot be written, it cannot describe the scene, or the scene continues it.
        """
        if scene.restart is not None and (scene.base_folder / scene.restart).resolve() == path.resolve():
            raise InputError(f"{path}: is the trajectory that the scene continues; write to another file")
        start_time = scene.start_time if start_time is None else start_time
        text = scene.with_paths_relative_to(path.parent, root).to_yaml()
        self._target = path
        # An existing file is replaced at the end, so that a run that fails before loses nothing.
        self._path = path.with_name(f"{path.stem}.new{path.suffix}") if path.is_file() else path
        self._check_disk_space(SPARE_BYTES)
        # Whatever ends the program, a file of this name is a trajectory, if one without frames. Windows renames no file
        # that is open; closing and opening it would move its tables to its end, where a file is cut off first.
        partial = self._path if os.name == "nt" else self._path.with_name(f".{self._path.name}.partial")
        try:
            self._file = h5py.File(partial, "w")
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else single_line(error)
            with suppress(OSError):
                partial.unlink(missing_ok=True)
            raise InputError(f"{path}: cannot be written ({reason})") from None
        self._space = ReservedSpace(self._path)
        try:
            ReservedSpace(partial, self._path).reserve(len(text) + 8 * particles + SPARE_BYTES)
            self._sets = self._write_head(text, scene, provenance, particles, start_time)
            partial.replace(self._path)
        except BaseException as error:  # an interrupt, too, leaves nothing that is no trajectory
            with suppress(OSError, RuntimeError):  # the same error once more
                self._file.close()
            partial.unlink(missing_ok=True)
            if isinstance(error, OSError) and error.errno:
                raise InputError(f"{path}: cannot be written ({os.strerror(error.errno)})") from None
            raise
        self._poses: list[Mapping[str, Pose]] = []  # of the frames in the buffer
        # The first frame of each particle and the one after its last. All zero for those that have not yet come.
        self._lifetimes = np.zeros((particles, 2), np.int64)
        self._forces: list[Mapping[str, Wrench]] = []
        self._liquids = np.zeros(particles, np.uint8)
        self._bodies: list[Mapping[str, np.ndarray]] = []
        # Frames that are not yet written, and memory to shuffle a chunk in. Reused memory stays in the cache.
        self._buffer = np.empty((2, FRAMES_PER_FLUSH, particles, 3), dtype=np.float32)
        self._shuffled = np.empty((4, FRAMES_PER_CHUNK * particles * 3), dtype=np.uint8)
        self._written = 0
        self._buffered = 0

    def _write_head(
        self, text: str, scene: Scene, provenance: Provenance, particles: int, start_time: float
    ) -> list[h5py.Dataset]:
        """Write all but the frames; returns the data sets of positions and velocities."""
        self._file.attrs.update(
            {
                "scene": text,
                "frame_time": scene.frame_time,
                "radius": scene.particle_radius,
                "model": provenance.simulator,
                "seed": provenance.seed,
                "version": provenance.version,
            }
        )
        if scene.restart is not None or start_time != 0:
            self._file.attrs["start_time"] = start_time
        group = self._file.create_group(GROUP)
        sets = [
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
        if scene.mixture:
            group["liquid"] = np.zeros(particles, np.uint8)
            group["liquid"].attrs["density"] = [liquid.density for liquid in scene.mixture]
        group["particle_type"] = np.full(particles, FLUID_TYPE, dtype=np.int64)
        self._file.flush()
        return sets

    @property
    def frames(self) -> int:
        """Number of frames so far, including those in the buffer."""
        return self._written + self._buffered

    @property
    def particles(self) -> int:
        """Number of particles that are or were in the scene."""
        return int((self._lifetimes[:, 1] > 0).sum())

    @property
    def entered(self) -> int:
        """Number of particles that came after the first frame."""
        return int((self._lifetimes[:, 0] > 0).sum())

    @property
    def left(self) -> int:
        """Number of particles that are no longer in the scene."""
        return int(((self._lifetimes[:, 1] > 0) & (self._lifetimes[:, 1] < self.frames)).sum())

    def write_attributes(self, group: str, values: Mapping[str, object]) -> None:
        """Write ``values`` (numbers, texts, arrays) as attributes of a new group."""
        self._file.create_group(group).attrs.update(values)

    def append(
        self,
        positions: np.ndarray,
        velocities: np.ndarray,
        poses: Mapping[str, Pose] | None = None,
        ids: np.ndarray | None = None,
        forces: Mapping[str, Wrench] | None = None,
        liquids: np.ndarray | None = None,
        bodies: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        """Append a copy of one frame.

        Args:
            positions: (N, 3), meters.
            velocities: (N, 3), m/s.
            poses: by name of all that moves.
            ids: (N,) of the particles that are in the scene, below the number of particles; by default all are.
            forces: of the fluid on solids, by name.
            liquids: (N,), in a scene of several liquids the number of each particle's.
            bodies: velocities and accelerations (12,) of rigid bodies, by name.

        Raises:
            InputError: the disk is full.
            ValueError: a shape is not (N, 3).
        """
        frame = self._buffer[:, self._buffered]
        some = ids is not None and len(ids) != frame.shape[1]
        shape = (len(ids), 3) if some and ids is not None else frame.shape[1:]
        for target, values in zip(frame, (positions, velocities), strict=True):
            if np.shape(values) != shape:
                raise ValueError(f"a frame is of shape {np.shape(values)} instead of {shape}")
            if some:
                target[:] = np.nan
                target[ids] = values
            else:
                target[:] = values
        here = self._lifetimes[ids if some else slice(None)]
        new = here[:, 1] == 0
        here[new, 0] = self.frames
        here[:, 1] = self.frames + 1
        if some:
            self._lifetimes[ids] = here
        if liquids is not None:
            self._liquids[ids if some else slice(None)] = liquids
        frame[1] /= VELOCITY_STEP
        np.round(frame[1], out=frame[1])
        frame[1] *= VELOCITY_STEP
        self._poses[self._buffered :] = [poses or {}]
        self._forces[self._buffered :] = [forces or {}]
        self._bodies[self._buffered :] = [bodies or {}]
        self._buffered += 1
        if self._buffered == FRAMES_PER_FLUSH:
            self.flush()

    def flush(self) -> None:
        """Write the buffered frames. A call after an interrupt writes the same frames to the same place again.

        Raises:
            InputError: the disk is full; the file holds the earlier frames.
        """
        if not self._buffered:
            return
        frames = self._buffer[:, : self._buffered]
        needed, kept = frames.nbytes + SPARE_BYTES, f"; {self._written} frames are kept"
        self._check_disk_space(needed, kept)
        self._space.reserve(self._file.id.get_filesize() + needed, kept)
        try:
            for data, values in zip(self._sets, frames, strict=True):
                data.resize(self.frames, axis=0)
                write_chunks(data, self._written, values, self._shuffled)
            self._write_poses()
            self._write_lifetimes()
            self._write_forces()
            self._write_bodies()
            if LIQUIDS in self._file:
                self._file[LIQUIDS][:] = self._liquids
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._path}: cannot be written ({single_line(error)})") from None
        # A buffer that is not full keeps its frames; the next flush writes them again with the new ones.
        if self._buffered == FRAMES_PER_FLUSH:
            # One statement: an interrupt between two would count frames twice.
            self._written, self._buffered = self.frames, 0

    def _write_lifetimes(self) -> None:
        """Write when each particle was in the scene, unless all were in all frames."""
        if (self._lifetimes == (0, self.frames)).all():
            return
        if LIFETIMES in self._file:
            self._file[LIFETIMES][:] = self._lifetimes
        else:
            self._file[LIFETIMES] = self._lifetimes

    def _write_poses(self) -> None:
        """Write the poses of the buffered frames of everything that has moved so far."""
        names = {**dict.fromkeys(self._file.get(POSES, ())), **{name: None for poses in self._poses for name in poses}}
        for name in names:
            path = f"{POSES}/{name}"
            known = path in self._file and self._written > 0
            rows = filled_poses(self._poses, name, self._file[path][self._written - 1] if known else None)
            self._write_rows(path, rows, rows[0])

    def _write_forces(self) -> None:
        """Write the forces and torques of the buffered frames; NaN where a frame has none."""
        names = {
            **dict.fromkeys(self._file.get(WRENCHES[0], ())),
            **{n: None for forces in self._forces for n in forces},
        }
        none = Wrench(np.full(3, np.nan), np.full(3, np.nan))
        for name in names:
            wrenches = [forces.get(name, none) for forces in self._forces]
            for group, rows in zip(WRENCHES, zip(*wrenches, strict=True), strict=True):
                self._write_rows(f"{group}/{name}", np.array(rows), none.force)

    def _write_bodies(self) -> None:
        """Write how the rigid bodies move in the buffered frames; NaN where a frame does not have one."""
        names = {**dict.fromkeys(self._file.get(BODIES, ())), **{n: None for bodies in self._bodies for n in bodies}}
        none = np.full(12, np.nan)
        for name in names:
            self._write_rows(f"{BODIES}/{name}", np.array([bodies.get(name, none) for bodies in self._bodies]), none)

    def _write_rows(self, path: str, rows: np.ndarray, missing: np.ndarray) -> None:
        """Write rows (K, width) of the buffered frames; a new data set has ``missing`` (width,) in earlier frames."""
        if path not in self._file:
            earlier = np.repeat(missing[None], self._written, axis=0)
            self._file.create_dataset(path, data=earlier, maxshape=(None, len(missing)))
        data = self._file[path]
        data.resize(self._written + len(rows), axis=0)
        data[self._written :] = rows

    def _check_disk_space(self, needed: int, kept: str = "") -> None:
        try:
            free = shutil.disk_usage(self._path.parent).free
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written ({error.strerror})") from None
        if free < needed:
            raise InputError(f"{self._path}: cannot be written: the disk is full ({free / 1e6:.3g} MB are free){kept}")

    def __enter__(self) -> TrajectoryWriter:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        complete = error is None
        try:
            self.flush()
        except InputError:
            complete, self._buffered = False, 0
            if error is None:
                raise
        finally:
            self._close()
            if not (self.frames or complete):
                self._path.unlink()
        if complete and self._path != self._target:
            self._path.replace(self._target)
            self._path = self._target

    def _close(self) -> None:
        """Close the file and give back the space that it does not use.

        Raises:
            InputError: the disk is full.
        """
        try:
            self._file.flush()
            size = self._file.id.get_filesize()
            self._file.close()
            self._space.release(size)
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._path}: cannot be written ({single_line(error)})") from None

    @property
    def path(self) -> Path:
        """Where the frames are: beside the file that they replace until they are complete."""
        return self._path


def filled_poses(frames: Sequence[Mapping[str, Pose]], name: str, last: np.ndarray | None) -> np.ndarray:
    """The poses (frames, 7) of a solid: in frames that do not know it, the ``last`` (7,) before, or else the next."""
    if last is None:
        last = next(poses[name].array for poses in frames if name in poses)
    rows = []
    for poses in frames:
        last = poses[name].array if name in poses else last
        rows.append(last)
    return np.array(rows)


def write_chunks(data: h5py.Dataset, first: int, frames: np.ndarray, shuffled: np.ndarray) -> None:
    """Write ``frames`` (K, N, 3) float32 to the frames of ``data`` from ``first``.

    Args:
        data: the data set.
        first: number of the first frame to write; a chunk starts there.
        frames: the new values; contiguous ones are not copied.
        shuffled: scratch memory (4, FRAMES_PER_CHUNK * N * 3) uint8.
    """
    for start in range(0, len(frames), FRAMES_PER_CHUNK):
        chunk = frames[start : start + FRAMES_PER_CHUNK]
        # HDF5's shuffle: the first bytes of all values, then their second bytes, and so on. Zeros pad the last chunk.
        byte_planes = np.ascontiguousarray(chunk).reshape(-1).view(np.uint8).reshape(-1, shuffled.shape[0]).T
        shuffled[:, : byte_planes.shape[1]] = byte_planes
        shuffled[:, byte_planes.shape[1] :] = 0
        data.id.write_direct_chunk((first + start, 0, 0), isal_zlib.compress(shuffled, COMPRESSION_LEVEL))


def read_chunks(data: h5py.Dataset, first: int, count: int) -> np.ndarray:
    """Read frames (count, N, 3) from ``first``, with ISA-L if the chunks are as :func:`write_chunks` writes them."""
    length = data.chunks[0] if data.chunks else 0
    end = first + count
    fast = length and data.shuffle and data.compression == "gzip" and data.dtype == np.float32 and end <= len(data)
    if not fast or data.chunks[1:] != data.shape[1:]:
        return data[first:end]
    begin = first - first % length
    size = int(np.prod(data.chunks)) * data.dtype.itemsize
    chunks = []
    for start in range(begin, end, length):
        _, compressed = data.id.read_direct_chunk((start, 0, 0))
        shuffled = np.frombuffer(isal_zlib.decompress(compressed, bufsize=size), dtype=np.uint8)
        chunks.append(shuffled.reshape(data.dtype.itemsize, -1).T.copy().view(np.float32).reshape(data.chunks))
    return np.concatenate(chunks)[first - begin : end - begin] if chunks else data[first:end]


def not_a_trajectory(path: Path, error: Exception) -> str:
    """The message about an unreadable file."""
    return f"{path}: is not a trajectory of surfsup, or was cut off ({single_line(error)})"


def single_line(error: Exception) -> str:
    """The message of the HDF5 library, which may have several lines, as one."""
    return " ".join(str(error).split())
