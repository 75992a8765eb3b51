"""Loads SPlisHSPlasH without a crash if OpenGL is missing or comes from the system."""

from __future__ import annotations

import ctypes
from types import ModuleType

from surfsup.errors import InputError

# The solver's wheel contains parts of OpenGL that conflict with the system's unless the system's are loaded first.
OPENGL_LIBRARIES = ("libGLX.so.0", "libGLdispatch.so.0", "libGL.so.1")
DEBIAN_PACKAGES = ("libgl1",)


def load_solver() -> ModuleType:
    """The module ``pysplishsplash``.

    Raises:
        InputError: the package or a library of the system is missing; the message says what to install.
    """
    for name in OPENGL_LIBRARIES:
        try:
            ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
        except OSError:
            raise InputError(
                f"the reference solver needs {name}, which this system lacks: apt-get install "
                + " ".join(DEBIAN_PACKAGES)
            ) from None
    try:
        import pysplishsplash
    except ModuleNotFoundError:
        raise InputError("the reference solver is not installed: pip install 'surfsup[reference]'") from None
    return pysplishsplash
