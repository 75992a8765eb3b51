"""Checks of what this machine provides for surfsup, with the commands that fix what is missing."""

from __future__ import annotations

import os
import platform
import shutil
import sys
import time
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from surfsup import __version__
from surfsup.errors import InputError, SimulationError

WARM_UP_FRAMES, TIMED_FRAMES = 10, 30
REINSTALL = "pip install --force-reinstall surfsup"


@dataclass(frozen=True)
class Check:
    """The result of one check.

    Attributes:
        name: what was checked.
        passed: whether surfsup can use it.
        found: what this machine has.
        remedy: the command that fixes a failure, empty if the check passed.
    """

    name: str
    passed: bool
    found: str
    remedy: str = ""


def run_checks() -> list[Check]:
    """Check everything that surfsup uses."""
    shipped = [check_weights(), check_neural_surfaces()]
    hardware = [check_python(), check_torch(), check_native_code(), check_processor()]
    return [*hardware, check_speed(), *shipped, check_graphics(), check_reference_solver(), check_cache(), check_disk()]


def check_python() -> Check:
    """The interpreter."""
    return Check("Python", True, f"{platform.python_version()} at {sys.executable}; surfsup {__version__}")


def check_torch() -> Check:
    """Whether torch uses the GPU, if there is one."""
    import torch

    if torch.cuda.is_available():
        return Check("torch", True, f"{torch.__version__}, computes on {torch.cuda.get_device_name()}")
    found = f"{torch.__version__}, computes on the CPU with {torch.get_num_threads()} threads"
    if os.path.exists("/dev/nvidiactl"):
        return Check("torch", False, f"{found}, although there is an NVIDIA GPU", "see 'GPU' in docs/install.md")
    return Check("torch", True, found)


def check_native_code() -> Check:
    """The C++ code of the solver."""
    from surfsup import native

    if native.instruction_sets():
        return Check("native code", True, f"built, uses {native.instruction_sets()[0]}")
    return Check(
        "native code",
        False,
        "not built, because there was no C++ compiler: on a CPU a frame takes several times as long",
        "apt-get install g++ python3-dev, then reinstall surfsup: rm -f .venv/ready && make setup",
    )


def check_speed() -> Check:
    """The time of a frame, measured."""
    from surfsup.scene import FRAME_TIME, Block, Scene
    from surfsup.sdf import Sphere, Transformed
    from surfsup.simulation import Simulation

    ball = Transformed(Sphere(0.3), translation=(0, 0, 0.3))
    scene = Scene(surface=ball, fluid=[Block((-0.2, -0.2, 0.62), (0.2, 0.2, 1.1))])
    try:
        simulation = Simulation(scene)
        for _ in range(WARM_UP_FRAMES):
            simulation.step()
        began = time.perf_counter()
        for _ in range(TIMED_FRAMES):
            frame = simulation.step()
    except (InputError, SimulationError) as error:
        return Check("speed", False, f"no frame can be simulated ({error})", REINSTALL)
    milliseconds = 1000 * (time.perf_counter() - began) / TIMED_FRAMES
    scene_text = f"{1000 * FRAME_TIME:g} ms of {len(frame.positions):,} particles on a ball"
    return Check("speed", True, f"a frame of {scene_text} takes {milliseconds:.1f} ms")


def check_processor() -> Check:
    """The cores that this process may use."""
    return Check("processor", True, f"{len(os.sched_getaffinity(0))} cores, {platform.machine()}")


def check_weights() -> Check:
    """The weights of learned simulators in the package."""
    from surfsup.learned.simulator_names import shipped

    names = ", ".join(shipped())
    return Check("weights", bool(names), names or "none in the package", "" if names else REINSTALL)


def check_neural_surfaces() -> Check:
    """The neural surfaces in the package."""
    from surfsup.sdf.neural.shipped_surfaces import shipped_surfaces

    names = ", ".join(shipped_surfaces())
    return Check("neural surfaces", bool(names), names or "none in the package", "" if names else REINSTALL)


def check_graphics() -> Check:
    """The graphics libraries for pictures and videos."""
    from surfsup.viewing.graphics import missing_packages

    missing = missing_packages()
    if missing:
        return Check("graphics", False, "libraries for off-screen rendering", f"apt-get install {' '.join(missing)}")
    return Check("graphics", True, f"pyvista {version('pyvista')} renders off-screen with EGL")


def check_reference_solver() -> Check:
    """SPlisHSPlasH."""
    from surfsup.splishsplash import solver

    try:
        solver.check_installed()
        return Check("reference solver", True, f"pySPlisHSPlasH {version('pysplishsplash')}")
    except (InputError, PackageNotFoundError) as error:
        problem, _, remedy = str(error).rpartition(": ")
        return Check("reference solver", False, problem or str(error), remedy)


def check_cache() -> Check:
    """The folder where meshes, their grids and their maps are kept."""
    from surfsup import cache

    if not cache.is_writable():
        remedy = "set SURFSUP_CACHE to a folder that can be written"
        return Check("cache", False, f"{cache.folder()} cannot be written: a mesh takes longer at every start", remedy)
    used, limit = cache.size() / 1e6, cache.MAX_BYTES / 1e6
    return Check("cache", True, f"{cache.folder()}, {used:.0f} MB of at most {limit:.0f} MB; it may be deleted")


def check_disk() -> Check:
    """Space for trajectories in the current folder."""
    free = shutil.disk_usage(".").free / 1e9
    return Check("disk", free > 1, f"{free:.0f} GB free here; 800 frames of 2,700 particles take about 40 MB")
