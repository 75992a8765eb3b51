"""Errors whose message is a single line for the user."""

import difflib
from collections.abc import Iterable


def printable(text: str) -> str:
    """A text for a terminal in one line: control characters and marks of direction, as in names of files, are escaped.

    Examples:
        >>> printable("a\\x1b[31m name")
        'a\\\\x1b[31m name'
    """
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def single_line(error: BaseException) -> str:
    """The message of another library's error, which may have several lines, as one.

    Examples:
        >>> single_line(ValueError("no\\n  header"))
        'no header'
    """
    return " ".join(str(error).split())


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint at the most similar of the ``known`` names, empty if none is similar.

    Examples:
        >>> did_you_mean("surfup", ["surfsup", "gns"])
        " (did you mean 'surfsup'?)"
    """
    near = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


class InputError(ValueError):
    """The user's input is unusable.

    The message is one line: what, where, and how to fix it. The command line prints it without a traceback and exits
    with status 2.

    Examples:
        >>> import surfsup as sf
        >>> sf.Scene(fluid=[sf.Block((0, 0, 0), (0.1, 0.1, 0.0))])
        Traceback (most recent call last):
        surfsup.errors.InputError: ...
    """


class Interrupted(BaseException):
    """The user interrupted a run that has finished a part of its work. The message says what is kept and where.

    Like KeyboardInterrupt it is no Exception, so that no handler of errors takes it for one.
    """


class SimulationError(RuntimeError):
    """A simulation or a training run failed, although the input is valid.

    The message is one line. The command line prints it without a traceback and exits with status 1.

    Examples:
        >>> import numpy as np, surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((0, 0, 0.5), (0.1, 0.1, 0.6))])
        >>> simulation = sf.Simulation(scene, device="cpu")
        >>> simulation.particles.block_positions[0][0] = np.nan
        >>> sf.Simulation(scene, device="cpu", particles=simulation.particles).step()
        Traceback (most recent call last):
        surfsup.errors.SimulationError: the simulation blew up: a particle's position is not a finite number
    """
