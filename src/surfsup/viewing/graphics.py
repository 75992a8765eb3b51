"""Whether this machine can draw off screen, found out before VTK is imported, for VTK crashes where it
cannot.

VTK draws through EGL. On Linux that is two things: the loader `libEGL.so.1`, and a driver behind it (Mesa's
software one where there is no graphics card). Without either VTK does not raise: the process ends in a
segmentation fault. libGL and X11 are not needed, provided that VTK is told to open an EGL window instead of
looking for an X server first.
"""

import ctypes
import functools
import os
import sys

from surfsup.errors import InputError

LOADER_PACKAGE = "libegl1"
DRIVER_PACKAGE = "libgl1-mesa-dri"

_PLATFORM_DEVICE = 0x313F  # EGL_PLATFORM_DEVICE_EXT, of the extension EGL_EXT_platform_device
_MOST_DEVICES = 16


def missing_packages() -> list[str]:
    """Debian packages that off-screen drawing lacks on this machine; empty where it can draw.

    Nothing is looked for outside Linux, where VTK brings what it needs.
    """
    if not sys.platform.startswith("linux"):
        return []
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")  # Mesa's own warnings; ours says how to mend it
    try:
        egl = _open_library("libEGL.so.1")
    except OSError:
        # The driver cannot be tried without its loader: name both, so that one command is enough.
        return [LOADER_PACKAGE, DRIVER_PACKAGE]
    return [] if _display_starts(egl) else [DRIVER_PACKAGE]


@functools.cache
def require_graphics() -> None:
    """Make sure that VTK can draw off screen. Call this before pyvista or vtk is imported.

    Raises InputError, naming the Debian packages to install, where it cannot.
    """
    missing = missing_packages()
    if missing:
        raise InputError(
            "pictures and videos need off-screen OpenGL, which this machine lacks: "
            f"apt-get install {' '.join(missing)} (or leave them out: --no-video)"
        )
    if sys.platform.startswith("linux"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


def _open_library(name: str) -> ctypes.CDLL:
    return ctypes.CDLL(name)


def _display_starts(egl: ctypes.CDLL) -> bool:
    """Whether any EGL display starts: first the default one, then each device, in the order in which VTK
    tries them.

    Displays are left initialized: ending one would end it for everything else in this process as well.
    """
    egl.eglGetDisplay.restype = ctypes.c_void_p
    egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
    egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]

    def starts(display: int | None) -> bool:
        return bool(display) and bool(egl.eglInitialize(display, None, None))

    return starts(egl.eglGetDisplay(None)) or any(starts(display) for display in _device_displays(egl))


def _device_displays(egl: ctypes.CDLL) -> list[int | None]:
    query_address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    display_address = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query_address or not display_address:
        return []
    query = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query_address)
    platform_display = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(
        display_address
    )
    devices, count = (ctypes.c_void_p * _MOST_DEVICES)(), ctypes.c_int(0)
    if not query(_MOST_DEVICES, devices, ctypes.byref(count)):
        return []
    return [platform_display(_PLATFORM_DEVICE, device, None) for device in devices[: count.value]]
