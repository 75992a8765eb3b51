"""One simulated scene in one folder: trajectory, page, video and summary."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.scene import Container, Scene, Start
from surfsup.sdf import Surface

BYTES_PER_VALUE = 4

Tell = Callable[[int, int], None]


@dataclass(frozen=True)
class Summary:
    """What came of a simulation.

    Attributes:
        particles, frames: how many.
        seconds: of computing, writing included.
        ms_per_frame: of the simulator alone, without its set-up.
        penetrations: particles inside the solid, summed over frames.
        out_of_container: particles outside the container, likewise.
        model: what simulated.
        device: where.
        version: of surfsup.
    """

    particles: int
    frames: int
    seconds: float
    ms_per_frame: float
    penetrations: int
    out_of_container: int
    model: str
    device: str
    version: str = __version__


def writable_folder(path: Path) -> Path:
    """The folder, made where it is not there.

    Raises:
        InputError: it is a file, or cannot be written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be used as the output folder ({error.strerror}); give another with -o"
        ) from None
    return path


class OutputFolder:
    """The folder that a simulation writes into."""

    def __init__(self, path: Path, particles: int, frames: int) -> None:
        """Take ``path`` as the output folder of a simulation of that size, and make it.

        Raises:
            InputError: it is a file, cannot be written, or its disk has too little room for the trajectory.
        """
        self.path = path
        self.trajectory = path / "trajectory.h5"
        self.page = path / "page.html"
        self.video = path / "video.mp4"
        self.summary = path / "summary.json"
        check_room(path, particles, frames)
        writable_folder(path)

    def record(
        self,
        scene: Scene,
        surface: Surface | None,
        start: Start,
        frames: Iterable[tuple[np.ndarray, np.ndarray]],
        provenance: Provenance,
        device: str,
        tell: Tell,
    ) -> Summary:
        """Take the frames as the simulator makes them, write them, and sum up.

        An interrupt leaves a readable trajectory of the frames done and their summary, and goes on to the caller.
        """
        began, simulating = time.perf_counter(), 0.0
        strays: list[tuple[int, int]] = []
        source = iter(frames)
        writer = TrajectoryWriter(self.trajectory, scene, provenance, len(start.positions))
        try:
            with writer:
                while True:
                    before = time.perf_counter()
                    frame = next(source, None)
                    # The step to frame 1 carries the set-up: maps, first touches of memory.
                    simulating += time.perf_counter() - before if writer.frames > 1 else 0.0
                    if frame is None:
                        break
                    strays.append(count_strays(scene.container, surface, frame[0]))
                    writer.append(*frame)
                    tell(writer.frames, scene.frames)
        finally:
            done = writer.frames  # an interrupt may have come between a frame and anything that counts it
            inside, outside = (sum(counts) for counts in zip((0, 0), *strays[:done], strict=True))
            summary = Summary(
                particles=len(start.positions),
                frames=done,
                seconds=round(time.perf_counter() - began, 2),
                ms_per_frame=round(1000 * simulating / max(1, done - 2), 3),
                penetrations=inside,
                out_of_container=outside,
                model=provenance.model,
                device=device,
            )
            if done:
                self.summary.write_text(json.dumps(asdict(summary), indent=2) + "\n")
        return summary


def count_strays(container: Container, surface: Surface | None, positions: np.ndarray) -> tuple[int, int]:
    """How many of ``positions`` (N, 3) are inside the surface, and how many outside the container."""
    lower, upper = np.float32(container.lower), np.float32(container.upper)
    outside = int(((positions < lower) | (positions > upper)).any(axis=-1).sum())
    if surface is None:
        return 0, outside
    with torch.no_grad():
        return int((surface.distance(torch.from_numpy(positions)) < 0).sum()), outside


def check_room(path: Path, particles: int, frames: int) -> None:
    """Refuse to start what cannot end: the trajectory must find room on the disk that ``path`` is on.

    Raises:
        InputError: there is less free than the frames may take.
    """
    existing = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    needed = particles * frames * 6 * BYTES_PER_VALUE
    free = shutil.disk_usage(existing).free
    if free < needed:
        raise InputError(
            f"{path}: {frames} frames of {particles} particles take up to {needed / 1e6:.0f} MB, but only "
            f"{free / 1e6:.0f} MB are free; give fewer --frames or another folder with -o"
        )
