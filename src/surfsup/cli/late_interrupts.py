"""Ctrl-C in a place from which Python raises nothing, such as a destructor or a callback of C++."""

from __future__ import annotations

import _thread
import sys
import threading

LATER = 0.05  # seconds


def interrupt_once_more(unraisable: sys.UnraisableHookArgs) -> None:
    """Interrupt the main thread where an interrupt was dropped; Python would print a traceback and continue.

    Any other error that cannot be raised is printed as always. To be ``sys.unraisablehook``.
    """
    if unraisable.exc_type is KeyboardInterrupt:
        again = threading.Timer(LATER, _thread.interrupt_main)  # at once would be in this call, and dropped, too
        again.daemon = True
        again.start()
    else:
        sys.__unraisablehook__(unraisable)
