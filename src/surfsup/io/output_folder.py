"""The output folder of one simulation: trajectory, page, video and summary."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from surfsup import __version__
from surfsup.errors import InputError, Interrupted
from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Container, Scene
from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER, Solids
from surfsup.scene.wrench import Wrench
from surfsup.sdf.native_query import distance_native

BYTES_PER_VALUE = 4


class OutputFrame(NamedTuple):
    """A frame of a simulator, as :meth:`TrajectoryWriter.append` takes it.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        poses: of what moves, by name.
        ids: (N,) of the particles; None where no water enters or leaves.
        forces: on solids, by name.
        liquids: (N,), number of the liquid of each particle; None in a scene of one.
        bodies: velocities and accelerations (12,) of rigid bodies, by name.
    """

    positions: np.ndarray
    velocities: np.ndarray
    poses: Mapping[str, Pose]
    ids: np.ndarray | None = None
    forces: Mapping[str, Wrench] | None = None
    liquids: np.ndarray | None = None
    bodies: Mapping[str, np.ndarray] | None = None


@dataclass(frozen=True)
class Summary:
    """The content of ``summary.json``.

    Attributes:
        particles, frames: numbers of particles and frames.
        entered, left: numbers of particles that came through taps and left through drains.
        seconds: wall-clock time in all, the sum of the next three with ``frames - 2`` times ``ms_per_frame``.
        start_up: seconds until the second frame: files, distances, boundary volume maps, first touches of memory.
        ms_per_frame: time of the simulator for each frame after the second.
        writing: seconds of counting penetrations and writing frames.
        penetrations: number of particles inside the solid, summed over frames.
        out_of_container: number of particles outside the container, summed over frames.
        crossings: number of times that the straight way of a particle in a step led through a solid; None where the
            steps are not known. A continued simulation counts from where it continues.
        model: name of the simulator.
        device: device of the simulation, such as "cpu".
        version: version of surfsup.
    """

    particles: int
    frames: int
    seconds: float
    start_up: float
    ms_per_frame: float
    writing: float
    penetrations: int
    out_of_container: int
    model: str
    device: str
    crossings: int | None = None
    entered: int = 0
    left: int = 0
    version: str = __version__


def writable_folder(path: Path) -> Path:
    """Create the folder ``path`` if it does not exist, and return it.

    Raises:
        InputError: it is a file, or not writable.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=path).close()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be used as the output folder ({error.strerror}); give another with -o"
        ) from None
    return path


class OutputFolder:
    """The folder that a simulation writes to.

    Attributes:
        path: the folder.
        trajectory, page, video, summary: its files.
    """

    def __init__(self, path: Path, particles: int, frames: int) -> None:
        """Create the folder ``path`` for a simulation of that many particles and frames.

        Raises:
            InputError: it is a file, is not writable, or its disk has too little space for the trajectory.
        """
        self.path = path
        self.trajectory = path / "trajectory.h5"
        self.page = path / "page.html"
        self.video = path / "video.mp4"
        self.summary = path / "summary.json"
        self._particles = particles
        check_disk_space(path, particles, frames)
        writable_folder(path)

    def record(
        self,
        scene: Scene,
        solids: Solids,
        frames: Iterable[OutputFrame],
        provenance: Provenance,
        device: str,
        on_progress: Callable[[int, int], None],
        began: float | None = None,
        crossings: Callable[[], int | None] = lambda: None,
    ) -> Summary:
        """Write the frames while the simulator computes them, then the summary.

        After an interrupt the trajectory holds the finished frames and the summary describes them. If there was an
        older trajectory, it stays as it is, and the new frames are beside it.

        Args:
            scene: the simulated scene.
            solids: its solids.
            frames: of the simulator.
            provenance: simulator, seed and version.
            device: device of the simulation, for the summary.
            on_progress: called after each frame with the numbers of finished frames and of all frames.
            began: when the start-up began, by ``time.perf_counter``; now by default.
            crossings: how many there were so far, for the summary.

        Raises:
            InputError: the trajectory cannot be written.
            Interrupted: the user interrupted the simulation after its first frame.
        """
        began, simulating, writing = time.perf_counter() if began is None else began, 0.0, 0.0
        counts: list[tuple[int, int]] = []  # per frame: particles in the solid, particles out of the container
        source = iter(frames)
        penetrations_of = PenetrationCounter(scene.container, solids)
        writer = TrajectoryWriter(self.trajectory, scene, provenance, self._particles)
        try:
            with writer:
                while True:
                    before = time.perf_counter()
                    frame = next(source, None)
                    there = time.perf_counter()
                    # The step to frame 1 includes the setup: boundary volume maps, first touches of memory.
                    simulating += there - before if writer.frames > 1 else 0.0
                    if frame is None:
                        break
                    counts.append(penetrations_of.count(frame[0], frame[2]))
                    writer.append(*frame)
                    on_progress(writer.frames, scene.frames)
                    writing += time.perf_counter() - there
        except KeyboardInterrupt:
            if not writer.frames:
                raise
            kept = f"{writer.frames} of {scene.frames} frames are kept in {writer.path}; --resume adds the others"
            shown = self.path if writer.path == self.trajectory else writer.path
            kept = f"{kept}, surfsup view {shown} shows these"
            raise Interrupted(kept) from None
        finally:
            failing = sys.exc_info()[0] is not None
            done = writer.frames  # an interrupt may occur between counting a frame and writing it
            penetrations, out_of_container = (sum(column) for column in zip((0, 0), *counts[:done], strict=True))
            summary = Summary(
                particles=writer.particles,
                frames=done,
                seconds=round(seconds := time.perf_counter() - began, 2),
                start_up=round(seconds - simulating - writing, 2),
                writing=round(writing, 2),
                ms_per_frame=round(1000 * simulating / max(1, done - 2), 3),
                penetrations=penetrations,
                out_of_container=out_of_container,
                model=provenance.simulator,
                device=device,
                crossings=crossings(),
                entered=writer.entered,
                left=writer.left,
            )
            if done and writer.path == self.trajectory:
                # An error before, such as a full disk, says more than the same one here.
                with suppress(OSError) if failing else nullcontext(), atomic_file(self.summary) as partial:
                    partial.write_text(json.dumps(asdict(summary), indent=2) + "\n")
        return summary


class PenetrationCounter:
    """Counts particles inside a solid and outside the container, which may move, frame by frame.

    Where all solids stand still, a particle that has moved less than half of its last distance cannot be inside,
    whether its distance then was exact or a learned one twice too large. So it is not queried again.

    Args:
        container: the box around everything.
        solids: the solids of the scene.
    """

    def __init__(self, container: Container, solids: Solids) -> None:
        self._lower, self._upper = np.array(container.lower, np.float32), np.array(container.upper, np.float32)
        self._solids = solids
        self._positions, self._distance = np.zeros((0, 3), np.float32), np.zeros(0, np.float32)

    def count(self, positions: np.ndarray, poses: Mapping[str, Pose]) -> tuple[int, int]:
        """The numbers of ``positions`` (N, 3) float32 inside a solid and outside the container."""
        own = poses[CONTAINER].to_own(positions).astype(np.float32) if CONTAINER in poses else positions
        outside = int(((own < self._lower) | (own > self._upper)).any(axis=-1).sum())
        surface = self._solids.at(poses)
        if surface is None:
            return 0, outside
        if len(positions) != len(self._positions) or self._solids.moving:
            self._positions, self._distance = positions.copy(), np.zeros(len(positions), np.float32)
        moved = np.linalg.norm(positions - self._positions, axis=-1)
        near = np.flatnonzero(~(2 * moved < self._distance))
        self._positions[near] = positions[near]
        points = torch.from_numpy(positions[near])
        with torch.no_grad():
            # The threads of torch wait for each other at every small operation, which a busy machine makes long.
            distance = distance_native(surface, points)
            self._distance[near] = (surface.distance(points) if distance is None else distance).numpy()
        return int((self._distance < 0).sum()), outside


def check_disk_space(path: Path, particles: int, frames: int) -> None:
    """Require disk space for the whole trajectory before the simulation starts.

    Raises:
        InputError: the disk of ``path`` has less free space than the frames may take.
    """
    existing = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    needed = particles * frames * 6 * BYTES_PER_VALUE
    free = shutil.disk_usage(existing).free
    if free < needed:
        raise InputError(
            f"{path}: {frames} frames of {particles} particles take up to {needed / 1e6:.0f} MB, but only "
            f"{free / 1e6:.0f} MB are free; give fewer --frames or another folder with -o"
        )
