"""Any simulator by its name: the solver, in short or long steps, shipped weights, or a weights file."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from surfsup.errors import InputError
from surfsup.sph.long_step_solver import LongStepSolver
from surfsup.sph.simulator import Simulator
from surfsup.sph.solver import DfsphSolver

if TYPE_CHECKING:
    from surfsup.learned.weights_file import Card

DEFAULT_SIMULATOR = "dfsph"
FAST_SIMULATOR = "dfsph-fast"
SOLVERS: dict[str, type[Simulator[Any]]] = {DEFAULT_SIMULATOR: DfsphSolver, FAST_SIMULATOR: LongStepSolver}


def load_simulator(name: str) -> tuple[Simulator[Any], Card | None]:
    """The simulator of a name, and the card of its weights, if it has any.

    Args:
        name: ``dfsph`` for the solver, ``dfsph-fast`` for the solver in long steps, the name of shipped weights such as
            ``surfsup``, or the path of a weights file.

    Raises:
        InputError: there is no such simulator, or its file cannot be used.
    """
    if name in SOLVERS:
        return SOLVERS[name](), None
    from surfsup.learned import weights_file

    if name not in weights_file.shipped() and not Path(name).is_file():
        near = difflib.get_close_matches(name, simulator_names(), n=1)
        hint = f" (did you mean '{near[0]}'?)" if near else ""
        known = ", ".join(simulator_names())
        raise InputError(f"there is no simulator '{name}'{hint}; known are {known}, or give a .safetensors file")
    return weights_file.load(weights_file.find(name))


def simulator_names() -> list[str]:
    """The names that :func:`load_simulator` knows without a file, the default first."""
    from surfsup.learned import weights_file

    return [*SOLVERS, *weights_file.shipped()]
