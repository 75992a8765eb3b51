"""The reference solver: runs a scene in SPlisHSPlasH, in a child process."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from surfsup.errors import InputError, SimulationError
from surfsup.scene import InitialParticles, Scene
from surfsup.scene.solids import Solids, build_solids
from surfsup.sdf import Surface
from surfsup.sph.boundary.scene_boundaries import exact_outside, scene_volume_maps, whole_map
from surfsup.sph.boundary.volume_map import VolumeMap
from surfsup.sph.interpolation import frames_needed, resample
from surfsup.sph.liquid import LiquidForces
from surfsup.sph.state import SUBSTEPS
from surfsup.splishsplash.entering_water import EnteringWater
from surfsup.splishsplash.job_files import write_job
from surfsup.splishsplash.solid_motion import SolidMotion

NAME = "SPlisHSPlasH 2.19 DFSPH"
PIPE_SIZE = 1 << 20  # bytes of frames that the solver can be ahead of the reader
INPUT_ERROR = f"{InputError.__module__}.{InputError.__name__}: "  # prefix of the last line of a traceback

Frame = tuple[np.ndarray, np.ndarray]


class SolverError(SimulationError):
    """The reference solver stopped early. The message is one line."""


def simulate(
    scene: Scene, surface: Surface | None, start: InitialParticles, threads: int = 1
) -> Generator[Frame, None, None]:
    """Run ``scene`` in SPlisHSPlasH and yield its frames as the solver makes them.

    Args:
        scene: container, gravity, number and rate of frames, and the solids that move.
        surface: the solid that stands still; the solver gets its volume map.
        start: the particles of frame 0.
        threads: of the solver.

    Yields:
        Positions (N, 3) in meters and velocities (N, 3) in m/s of one frame, both float32. Particle i is the same in
        all frames and in ``start``. Where water enters or leaves, N is the number of particles that are ever in the
        scene, and those that are not in it have NaN.

    Raises:
        SolverError: the child process ended early.
        InputError: the solver or a library that it needs is not installed, or the surface is not near the container.
    """
    if start.liquids is not None:
        yield from simulate_mixture(scene, surface, start, start.liquids, threads)
        return
    yield from simulate_in_order(scene, surface, start, threads)


def simulate_mixture(
    scene: Scene, surface: Surface | None, start: InitialParticles, liquids: np.ndarray, threads: int
) -> Generator[Frame, None, None]:
    """:func:`simulate` for particles of several ``liquids`` (N,), each of which is a fluid of the solver.

    Raises:
        InputError: water enters or leaves, or a liquid has no particles.
    """
    if scene.is_open:
        raise InputError("the reference takes several liquids without taps and drains only; omit these")
    kinds = range(len(scene.mixture))
    if missing := [kind for kind in kinds if not (liquids == kind).any()]:
        raise InputError(f"liquid {missing[0]} has no particles, which the reference requires; omit it")
    blocks, velocities = ([values[liquids == kind] for kind in kinds] for values in (start.positions, start.velocities))
    place = np.argsort(np.argsort(liquids, kind="stable"), kind="stable")
    by_liquid = InitialParticles(blocks, velocities, start.excluded, (), tuple(kinds))
    for positions, speeds in simulate_in_order(scene, surface, by_liquid, threads):
        yield positions[place], speeds[place]


def simulate_in_order(
    scene: Scene, surface: Surface | None, start: InitialParticles, threads: int
) -> Generator[Frame, None, None]:
    """:func:`simulate` for blocks in the order of the solver's fluids."""
    units = scene.units.around(scene, start)
    own_solids = replace(build_solids(scene) if scene.moves else Solids(surface), still=surface)
    own_solids.require_described()
    solids = units.solids_to_solver(own_solids, scene.start_time)
    solver_scene, start = units.scene_to_solver(scene), units.particles_to_solver(start)
    interval = scene.frame_time / units.frame_time
    count = frames_needed(scene.frames, interval)
    entering = EnteringWater.of(scene, own_solids, start, count) if scene.is_open else None
    frames = simulate_frames(solver_scene, solids, start, count, threads, entering)
    with contextlib.closing(frames):
        for frame in resample(frames, interval):
            yield units.frame_from_solver(*frame)


def simulate_frames(
    scene: Scene,
    solids: Solids,
    start: InitialParticles,
    count: int,
    threads: int,
    entering: EnteringWater | None = None,
) -> Generator[Frame, None, None]:
    """Run ``count`` frames of 5 ms of a scene in the units of the solver; see :func:`simulate`."""
    maps, motions = boundaries_of(scene, solids, count)
    with tempfile.TemporaryDirectory(prefix="surfsup-") as folder, tempfile.TemporaryFile() as log:
        scene_file = write_job(
            Path(folder),
            scene.gravity,
            start.block_positions,
            start.block_velocities,
            maps,
            motions,
            entering,
            LiquidForces.of_scene(scene),
        )
        frames = run_child(scene_file, count, len(start.positions), threads, log, entering)
        with contextlib.closing(frames):
            for number, frame in enumerate(frames):
                if number == 1:  # the solver has read all files by now; delete them before a kill can leave them behind
                    shutil.rmtree(folder)
                yield frame


def boundaries_of(scene: Scene, solids: Solids, frames: int) -> tuple[list[VolumeMap], list[SolidMotion | None]]:
    """The volume maps of walls and solids, and how each moves in ``frames``: walls first, then what stands still.

    Raises:
        InputError: a surface is not near the container, or too large to move.
    """
    maps, motions = scene_volume_maps(scene, solids.still), []
    if not scene.container.open:
        motions.append(None if solids.container is None else SolidMotion.of(solids.container, frames))
    motions += [None] * (len(maps) - len(motions))
    for solid in solids.moving:
        maps.append(whole_map(exact_outside(solid.surface), solid.name))
        motions.append(SolidMotion.of(solid.pose, frames))
    return maps, motions


def check_installed() -> None:
    """Check in a process of its own, which may crash, that the solver can be loaded.

    Raises:
        InputError: the solver or a library that it needs is missing; the message says what to install.
    """
    probe = "from surfsup.splishsplash.library import load_solver; load_solver()"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"it ended with status {done.returncode}"])[-1]
        raise InputError(last.removeprefix(INPUT_ERROR))


def run_child(
    scene_file: Path,
    frames: int,
    particles: int,
    threads: int,
    log: IO[bytes],
    entering: EnteringWater | None = None,
) -> Generator[Frame, None, None]:
    """Start the child process with ``scene_file`` and yield its frames; its messages go to ``log``."""
    particles = particles if entering is None else entering.count
    command = [sys.executable, "-m", "surfsup.splishsplash.child_process", str(scene_file), str(frames), str(SUBSTEPS)]
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive"}
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, env=environment)
    assert child.stdin is not None and child.stdout is not None
    enlarge_pipe(child.stdout)
    try:
        header = child.stdout.read(8)
        count = int.from_bytes(header, sys.byteorder)
        if len(header) == 8 and count != particles:
            raise SolverError(f"the reference solver started with {count} particles instead of {particles}")
        size = particles * 3 * 4
        absent = None if entering is None else AbsentParticles(entering, child.stdin)
        for frame in range(frames):
            data = child.stdout.read(2 * size)
            if len(data) < 2 * size:
                raise exit_error(child.wait(), frame, log)
            values = np.frombuffer(data, dtype=np.float32).reshape(2, particles, 3)
            positions, velocities = values[0].copy(), values[1].copy()
            if absent is not None:
                absent.mark(positions, velocities, frame)
            yield positions, velocities
        child.wait()
    finally:
        child.kill()
        child.stdout.close()
        with contextlib.suppress(BrokenPipeError):
            child.stdin.close()
        child.wait()


class AbsentParticles:
    """Marks the particles that are not in the scene, and gives the child process those that drains have taken.

    Args:
        entering: the water that enters and leaves.
        reply: standard input of the child process.
    """

    def __init__(self, entering: EnteringWater, reply: IO[bytes]) -> None:
        self._entering, self._reply = entering, reply
        self._gone = np.zeros(entering.count, bool)
        self._before = np.zeros((0, 3))

    def mark(self, positions: np.ndarray, velocities: np.ndarray, frame: int) -> None:
        """Set the positions and velocities (N, 3) of particles to NaN that are not in the scene in ``frame``.

        Raises:
            SolverError: the position of another one is not finite.
        """
        absent = self._gone | (self._entering.first_frames > frame)
        if not np.isfinite(positions[~absent]).all():
            raise SolverError(f"the reference solver has a position that is not finite in frame {frame}")
        positions[absent], velocities[absent] = np.nan, np.nan
        if self._entering.passages.drains and frame:
            taken = self._entering.taken(self._before, positions.astype(np.float64), frame)
            ids = np.flatnonzero(taken)
            with contextlib.suppress(BrokenPipeError):  # the child ended after its last frame
                self._reply.write(np.int64(len(ids)).tobytes() + ids.astype(np.int64).tobytes())
                self._reply.flush()
            self._gone |= taken
            positions[taken], velocities[taken] = np.nan, np.nan
        self._before = positions.astype(np.float64)


def enlarge_pipe(pipe: IO[bytes]) -> None:
    """Let ``pipe`` hold many frames, so that the solver continues while earlier frames are processed."""
    if hasattr(fcntl, "F_SETPIPE_SZ"):  # Linux
        with contextlib.suppress(OSError):  # the system may grant less, which is only slower
            fcntl.fcntl(pipe.fileno(), fcntl.F_SETPIPE_SZ, PIPE_SIZE)


def exit_error(status: int, frame: int, log: IO[bytes]) -> Exception:
    """The error of one line for a child that ended with ``status`` before it sent ``frame``."""
    log.seek(0)
    lines = [line.strip() for line in log.read().decode(errors="replace").splitlines() if line.strip(" -")]
    last = lines[-1] if lines else ""
    if last.startswith(INPUT_ERROR):
        return InputError(last.removeprefix(INPUT_ERROR))
    cause = f"signal {-status}" if status < 0 else f"status {status}"
    message = f": {last}" if last else ""
    return SolverError(f"the reference solver ended with {cause} before frame {frame}{message}")
