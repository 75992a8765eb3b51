"""Ground truth: a scene run by SPlisHSPlasH in a child process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.reference.job import PARTICLE_RADIUS, STEPS_PER_FRAME, write_job
from surfsup.scene import Scene, Start
from surfsup.sdf import Surface, to_mesh

NAME = "SPlisHSPlasH 2.19 DFSPH"
SURFACE_MESH_RESOLUTION = 96


class SolverError(RuntimeError):
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
    solid = None if surface is None else to_mesh(surface, SURFACE_MESH_RESOLUTION)
    # A name of its own for every job: jobs at work side by side share the folder and its container map.
    with tempfile.TemporaryDirectory(prefix="job-", dir=folder) as scratch:
        name = Path(scratch).name
        scene_file = write_job(folder, name, scene.container.size, scene.gravity, start.blocks, start.velocities, solid)
        try:
            yield from run_child(scene_file, scene.frames, len(start.positions), threads, Path(scratch) / "log")
        finally:
            remove_job(folder, name)


def require() -> None:
    """Refuse early where the solver cannot run; it is loaded in a process of its own, which may crash.

    Raises:
        InputError: the solver or a library that it needs is missing; says what to install.
    """
    probe = "from surfsup.reference.library import load_solver; load_solver()"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"it ended with status {done.returncode}"])[-1]
        raise InputError(last.removeprefix("surfsup.errors.InputError: "))


def run_child(
    scene_file: Path, frames: int, particles: int, threads: int, log: Path
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Start the child process on ``scene_file`` and yield the frames that it sends."""
    command = [sys.executable, "-m", "surfsup.reference.child", str(scene_file), str(frames), str(STEPS_PER_FRAME)]
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive"}
    with log.open("wb") as errors:
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env=environment)
    try:
        count = int.from_bytes(child.stdout.read(8), sys.byteorder)
        size = particles * 3 * 4
        for frame in range(frames):
            data = child.stdout.read(2 * size)
            if len(data) < 2 * size:
                raise SolverError(why_it_ended(child.wait(), frame, log))
            if count != particles:
                raise SolverError(f"the solver started with {count} particles instead of {particles}")
            values = np.frombuffer(data, dtype=np.float32).reshape(2, particles, 3)
            yield values[0].copy(), values[1].copy()
        child.wait()
    finally:
        child.kill()
        child.stdout.close()
        child.wait()


def why_it_ended(status: int, frame: int, log: Path) -> str:
    """One line about a child that ended with ``status`` before it sent ``frame``."""
    cause = f"signal {-status}" if status < 0 else f"status {status}"
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip(" -")]
    said = f": {lines[-1]}" if lines else ""
    return f"the reference solver ended with {cause} before frame {frame}{said}"


def remove_job(folder: Path, name: str) -> None:
    """Take away what one job left in the shared folder; the container's map stays."""
    for pattern in (f"{name}*", f"Cache/{name}*"):
        for path in folder.glob(pattern):
            if path.is_file():
                path.unlink(missing_ok=True)


__all__ = ["NAME", "PARTICLE_RADIUS", "SolverError", "map_cache", "simulate"]
