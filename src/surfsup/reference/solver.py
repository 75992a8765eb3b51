"""Ground truth: a scene run by SPlisHSPlasH in a child process."""

from __future__ import annotations

import contextlib
import filecmp
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from surfsup.errors import InputError, SimulationError
from surfsup.reference.job import PARTICLE_RADIUS, STEPS_PER_FRAME, write_job
from surfsup.scene import Scene, Start
from surfsup.sdf import Surface, polygonise

NAME = "SPlisHSPlasH 2.19 DFSPH"
SURFACE_MESH_RESOLUTION = 96
MAPS = "Cache"  # where the solver keeps its boundary maps, beside its scene file
CONTAINER_MAPS = "container*"
INPUT_ERROR = f"{InputError.__module__}.{InputError.__name__}: "  # as it ends a traceback


class SolverError(SimulationError):
    """The reference solver stopped before it was done; the message is one line."""


def map_cache() -> Path:
    """The folder where boundary maps are kept between runs, as the system's cache conventions place it."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "surfsup" / "reference"


def simulate(
    scene: Scene, surface: Surface | None, start: Start, threads: int = 1, folder: Path | None = None
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Run ``scene`` in SPlisHSPlasH and yield its frames as the solver makes them.

    Args:
        scene: container, gravity and the number of frames.
        surface: the scene's solid; the solver gets its triangles.
        start: the particles of frame 0.
        threads: of the solver.
        folder: where the boundary maps are cached; :func:`map_cache` by default.

    Yields:
        Positions (N, 3) in metres and velocities (N, 3) in m/s of one frame, both float32. Particle i is
        the same in every frame and in ``start``.

    Raises:
        SolverError: the child process ended early.
        InputError: the solver or a library that it needs is not installed.
    """
    folder = folder or map_cache()
    folder.mkdir(parents=True, exist_ok=True)
    solid = None if surface is None else polygonise(surface, SURFACE_MESH_RESOLUTION)
    # The solver writes its maps in place. So every job has a folder of its own, and what others may read
    # is put into the shared cache whole: no job at work beside it and no killed one can spoil the cache.
    with tempfile.TemporaryDirectory(prefix="job-", dir=folder) as scratch:
        job = Path(scratch)
        take_container_maps(folder / MAPS, job / MAPS)
        scene_file = write_job(job, scene.container.size, scene.gravity, start.blocks, start.velocities, solid)
        frames = run_child(scene_file, scene.frames, len(start.positions), threads, job / "log")
        with contextlib.closing(frames):
            for number, frame in enumerate(frames):
                if number == 1:  # the solver makes its maps before the first step, but after it has given frame 0
                    give_container_maps(job / MAPS, folder / MAPS)
                yield frame


def take_container_maps(cache: Path, own: Path) -> None:
    """Copy what other jobs have found out about containers."""
    own.mkdir()
    for path in cache.glob(CONTAINER_MAPS):
        shutil.copyfile(path, own / path.name)


def give_container_maps(own: Path, cache: Path) -> None:
    """Put this job's maps of its container where other jobs find them, each file at once."""
    cache.mkdir(exist_ok=True)
    for path in own.glob(CONTAINER_MAPS):
        kept = cache / path.name
        if not kept.exists() or not filecmp.cmp(path, kept, shallow=False):
            whole = own.parent / path.name
            shutil.copyfile(path, whole)
            whole.replace(kept)


def require() -> None:
    """Refuse early where the solver cannot run; it is loaded in a process of its own, which may crash.

    Raises:
        InputError: the solver or a library that it needs is missing; says what to install.
    """
    probe = "from surfsup.reference.library import load_solver; load_solver()"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"it ended with status {done.returncode}"])[-1]
        raise InputError(last.removeprefix(INPUT_ERROR))


def run_child(
    scene_file: Path, frames: int, particles: int, threads: int, log: Path
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Start the child process on ``scene_file`` and yield the frames that it sends."""
    command = [
        sys.executable,
        "-m",
        "surfsup.reference.child",
        str(scene_file),
        str(frames),
        str(STEPS_PER_FRAME),
    ]
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive"}
    with log.open("wb") as errors:
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env=environment)
    try:
        header = child.stdout.read(8)
        count = int.from_bytes(header, sys.byteorder)
        if len(header) == 8 and count != particles:
            raise SolverError(f"the reference solver started with {count} particles instead of {particles}")
        size = particles * 3 * 4
        for frame in range(frames):
            data = child.stdout.read(2 * size)
            if len(data) < 2 * size:
                raise why_it_ended(child.wait(), frame, log)
            values = np.frombuffer(data, dtype=np.float32).reshape(2, particles, 3)
            yield values[0].copy(), values[1].copy()
        child.wait()
    finally:
        child.kill()
        child.stdout.close()
        child.wait()


def why_it_ended(status: int, frame: int, log: Path) -> Exception:
    """The error, of one line, about a child that ended with ``status`` before it sent ``frame``."""
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip(" -")]
    last = lines[-1] if lines else ""
    if last.startswith(INPUT_ERROR):
        return InputError(last.removeprefix(INPUT_ERROR))
    cause = f"signal {-status}" if status < 0 else f"status {status}"
    said = f": {last}" if last else ""
    return SolverError(f"the reference solver ended with {cause} before frame {frame}{said}")


__all__ = ["NAME", "PARTICLE_RADIUS", "SolverError", "map_cache", "simulate"]
