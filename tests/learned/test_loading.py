import pytest

from surfsup.errors import InputError
from surfsup.learned.loading import load_simulator
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.learned.simulator_names import simulator_names
from surfsup.sph.long_step_solver import LongStepSolver
from surfsup.sph.solver import DfsphSolver


def test_the_default_is_the_solver_which_has_no_weights():
    simulator, card = load_simulator("dfsph")
    assert isinstance(simulator, DfsphSolver)
    assert card is None
    assert simulator_names()[0] == "dfsph"


def test_long_steps_are_a_solver_too():
    simulator, card = load_simulator("dfsph-fast")
    assert isinstance(simulator, LongStepSolver)
    assert card is None


def test_shipped_weights_load_by_their_names():
    simulator, card = load_simulator("surfsup")
    assert isinstance(simulator, Surfsup)
    assert card.name == "surfsup"
    assert set(simulator_names()) == {"dfsph", "dfsph-fast", "surfsup", "gns", "value-only", "no-sdf"}


@pytest.mark.parametrize(("name", "meant"), [("dfshp", "dfsph"), ("surfsop", "surfsup")])
def test_a_misspelled_name_is_refused_with_the_nearest_one(name, meant):
    with pytest.raises(InputError, match=f"there is no simulator '{name}' .did you mean '{meant}'"):
        load_simulator(name)
