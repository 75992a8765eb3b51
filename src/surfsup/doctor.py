"""What this machine has and lacks for surfsup, and the command that mends it."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from surfsup import __version__
from surfsup.errors import InputError


@dataclass(frozen=True)
class Finding:
    """One thing looked at.

    Attributes:
        what: it is.
        fine: whether it is as surfsup needs it.
        found: what is there.
        remedy: the command that mends it, empty where nothing is wrong.
    """

    what: str
    fine: bool
    found: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything that surfsup needs."""
    shipped = [models(), surfaces()]
    return [python(), torch_build(), native_step(), processor(), *shipped, pictures(), reference_solver(), disk()]


def python() -> Finding:
    """The interpreter."""
    return Finding("Python", True, f"{platform.python_version()} at {sys.executable}; surfsup {__version__}")


def torch_build() -> Finding:
    """torch, and whether it sees a GPU."""
    import torch

    if torch.cuda.is_available():
        return Finding("torch", True, f"{torch.__version__}, computes on {torch.cuda.get_device_name()}")
    has_card = os.path.exists("/dev/nvidiactl")
    found = f"{torch.__version__}, computes on the CPU with {torch.get_num_threads()} threads"
    if has_card:
        return Finding("torch", False, f"{found}, though there is an NVIDIA GPU", "see 'GPU' in docs/install.md")
    return Finding("torch", True, found)


def native_step() -> Finding:
    """The convolution's step in C++."""
    from surfsup import native

    if native.instruction_sets():
        return Finding("native step", True, f"built, uses {native.instruction_sets()[0]}")
    return Finding(
        "native step",
        False,
        "not built, for want of a C++ compiler: on a CPU a frame takes several times as long",
        "apt-get install g++ python3-dev, then surfsup anew: rm -f .venv/ready && make setup",
    )


def processor() -> Finding:
    """Cores that this process may use."""
    return Finding("processor", True, f"{len(os.sched_getaffinity(0))} cores, {platform.machine()}")


def models() -> Finding:
    """The weights that come with the package."""
    from surfsup.learned.weights_file import shipped

    names = ", ".join(shipped())
    return Finding(
        "models",
        bool(names),
        names or "none shipped",
        "" if names else "pip install --force-reinstall surfsup",
    )


def surfaces() -> Finding:
    """The neural surfaces that come with the package."""
    from surfsup.sdf.neural.shipped_surfaces import shipped_surfaces

    names = ", ".join(shipped_surfaces())
    remedy = "" if names else "pip install --force-reinstall surfsup"
    return Finding("neural surfaces", bool(names), names or "none shipped", remedy)


def pictures() -> Finding:
    """The graphics libraries that pictures and videos need."""
    from surfsup.viewing.graphics import missing_packages

    missing = missing_packages()
    if missing:
        return Finding("pictures", False, "graphics libraries missing", f"apt-get install {' '.join(missing)}")
    return Finding("pictures", True, f"pyvista {version('pyvista')} draws off-screen by EGL")


def reference_solver() -> Finding:
    """SPlisHSPlasH."""
    from surfsup.splishsplash import solver

    try:
        solver.require()
        return Finding("reference solver", True, f"pySPlisHSPlasH {version('pysplishsplash')}")
    except (InputError, PackageNotFoundError) as error:
        what, _, remedy = str(error).rpartition(": ")
        return Finding("reference solver", False, what or str(error), remedy)


def disk() -> Finding:
    """Room for trajectories in the current folder."""
    free = shutil.disk_usage(".").free / 1e9
    return Finding("disk", free > 1, f"{free:.0f} GB free here; 800 frames of 2,700 particles take about 40 MB")
