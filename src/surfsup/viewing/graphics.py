"""Check that this machine can render off screen. The check comes before the import of VTK, which would crash otherwise.

VTK renders through EGL. On Linux that needs the loader ``libEGL.so.1`` and a driver (Mesa's software driver where there
is no graphics card). Without either VTK ends the process with a segmentation fault. libGL and X11 are not needed if VTK
is configured to open an EGL window instead of looking for an X server first.
"""

import ctypes
import functools
import os
import sys

from surfsup.errors import InputError

LOADER_PACKAGE = "libegl1"
DRIVER_PACKAGE = "libgl1-mesa-dri"

_PLATFORM_DEVICE = 0x313F  # EGL_PLATFORM_DEVICE_EXT, of the extension EGL_EXT_platform_device
_MAX_DEVICES = 16


def missing_packages() -> list[str]:
    """The Debian packages that off-screen rendering needs and this machine lacks.

    The list is always empty outside Linux, where VTK's wheel has all it needs.
    """
    if not sys.platform.startswith("linux"):
        return []
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")  # no warnings of Mesa's own; our message names the fix
    try:
        egl = _open_library("libEGL.so.1")
    except OSError:
        # Without the loader the driver cannot be checked. Both are named, so that one command is enough.
        return [LOADER_PACKAGE, DRIVER_PACKAGE]
    return [] if _display_starts(egl) else [DRIVER_PACKAGE]


@functools.cache
def require_graphics() -> None:
    """Ensure that VTK can render off screen. Call this before the import of pyvista or vtk.

    Raises:
        InputError: it cannot; the message names the Debian packages to install.
    """
    missing = missing_packages()
    if missing:
        raise InputError(
            "pictures and videos need off-screen OpenGL, which this machine lacks: "
            f"apt-get install {' '.join(missing)} (or use --no-video)"
        )
    if sys.platform.startswith("linux"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


def _open_library(name: str) -> ctypes.CDLL:
    return ctypes.CDLL(name)


def _display_starts(egl: ctypes.CDLL) -> bool:
    """Whether an EGL display starts: the default one or that of a device, in the order in which VTK tries them.

    The displays stay initialized, because other code of this process may use them.
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
    devices, count = (ctypes.c_void_p * _MAX_DEVICES)(), ctypes.c_int(0)
    if not query(_MAX_DEVICES, devices, ctypes.byref(count)):
        return []
    return [platform_display(_PLATFORM_DEVICE, device, None) for device in devices[: count.value]]
