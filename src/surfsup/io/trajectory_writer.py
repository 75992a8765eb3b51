"""Writes trajectory files; :mod:`~surfsup.io.trajectory_format` has their layout."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import TracebackType

import numpy as np

from surfsup.errors import InputError, single_line
from surfsup.io.frame_chunks import write_chunks
from surfsup.io.lifetime_table import LifetimeTable
from surfsup.io.named_rows import NamedRows, held, unknown
from surfsup.io.new_hdf5_file import new_hdf5_file
from surfsup.io.reserved_space import ReservedSpace, check_free_space
from surfsup.io.trajectory_format import (
    FORCES,
    FRAMES_PER_CHUNK,
    GROUP,
    POSES,
    TORQUES,
    VELOCITY_STEP,
    Provenance,
    write_head,
)
from surfsup.scene import Scene
from surfsup.scene.particle_file import LIQUIDS
from surfsup.scene.pose import Pose
from surfsup.scene.restarted_bodies import BODIES
from surfsup.scene.wrench import Wrench

FRAMES_PER_FLUSH = 8
SPARE_BYTES = 256 * 1024  # free disk space for the tables of the file


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
        check_free_space(self._path, SPARE_BYTES)
        head = partial(
            write_head, scene=scene, text=text, provenance=provenance, particles=particles, start_time=start_time
        )
        self._file = new_hdf5_file(self._path, path, len(text) + 8 * particles + SPARE_BYTES, head)
        self._sets = [self._file[f"{GROUP}/{name}"] for name in ("position", "velocity")]
        self._space = ReservedSpace(self._path)
        self._lifetimes = LifetimeTable(particles)
        self._liquids = np.zeros(particles, np.uint8)
        self._poses = NamedRows(POSES, 7, held)
        self._forces, self._torques = (NamedRows(group, 3, unknown) for group in (FORCES, TORQUES))
        self._bodies = NamedRows(BODIES, 12, unknown)
        # Frames that are not yet written, and memory to shuffle a chunk in. Reused memory stays in the cache.
        self._buffer = np.empty((2, FRAMES_PER_FLUSH, particles, 3), dtype=np.float32)
        self._shuffled = np.empty((4, FRAMES_PER_CHUNK * particles * 3), dtype=np.uint8)
        self._written = 0
        self._buffered = 0

    @property
    def path(self) -> Path:
        """Where the frames are: beside the file that they replace until they are complete."""
        return self._path

    @property
    def frames(self) -> int:
        """Number of frames so far, including those in the buffer."""
        return self._written + self._buffered

    @property
    def particles(self) -> int:
        """Number of particles that are or were in the scene."""
        return self._lifetimes.particles

    @property
    def entered(self) -> int:
        """Number of particles that came after the first frame."""
        return self._lifetimes.entered

    @property
    def left(self) -> int:
        """Number of particles that are no longer in the scene."""
        return self._lifetimes.left(self.frames)

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
        all_here = ids is None or len(ids) == frame.shape[1]
        here = slice(None) if ids is None or all_here else ids
        shape = frame.shape[1:] if ids is None else (len(ids), 3)
        for target, values in zip(frame, (positions, velocities), strict=True):
            if np.shape(values) != shape:
                raise ValueError(f"a frame is of shape {np.shape(values)} instead of {shape}")
            if not all_here:
                target[:] = np.nan
            target[here] = values
        self._lifetimes.add(self.frames, here)
        if liquids is not None:
            self._liquids[here] = liquids
        frame[1] /= VELOCITY_STEP
        np.round(frame[1], out=frame[1])
        frame[1] *= VELOCITY_STEP
        wrenches = forces or {}
        self._poses.put(self._buffered, {name: pose.array for name, pose in (poses or {}).items()})
        self._forces.put(self._buffered, {name: wrench.force for name, wrench in wrenches.items()})
        self._torques.put(self._buffered, {name: wrench.torque for name, wrench in wrenches.items()})
        self._bodies.put(self._buffered, bodies or {})
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
        check_free_space(self._path, needed, kept)
        self._space.reserve(self._file.id.get_filesize() + needed, kept)
        try:
            for data, values in zip(self._sets, frames, strict=True):
                data.resize(self.frames, axis=0)
                write_chunks(data, self._written, values, self._shuffled)
            self._poses.write(self._file, self._written)
            self._lifetimes.write(self._file, self.frames)
            for rows in (self._forces, self._torques, self._bodies):
                rows.write(self._file, self._written)
            if LIQUIDS in self._file:
                self._file[LIQUIDS][:] = self._liquids
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._path}: cannot be written ({single_line(error)})") from None
        # A buffer that is not full keeps its frames; the next flush writes them again with the new ones.
        if self._buffered == FRAMES_PER_FLUSH:
            # One statement: an interrupt between two would count frames twice.
            self._written, self._buffered = self.frames, 0

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
