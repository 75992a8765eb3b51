"""Any simulator by its name: the solver, in short or long steps, shipped weights, or a weights file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from surfsup.learned.simulator_names import DEFAULT_SIMULATOR, FAST_SIMULATOR, require_simulator
from surfsup.sph.long_step_solver import LongStepSolver
from surfsup.sph.simulator import Simulator
from surfsup.sph.solver import DfsphSolver

if TYPE_CHECKING:
    from surfsup.learned.weights_file import Card

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
    require_simulator(name)
    from surfsup.learned import weights_file

    return weights_file.load(weights_file.find(name))
