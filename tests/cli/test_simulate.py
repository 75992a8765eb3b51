import warnings
from types import SimpleNamespace

import pytest

from surfsup.cli.simulate import warn_of_misplaced


def summary(penetrations=0, out_of_container=0, crossings=0):
    return SimpleNamespace(penetrations=penetrations, out_of_container=out_of_container, crossings=crossings)


def test_particles_that_are_where_none_may_be_are_warned_of():
    with pytest.warns(UserWarning, match="a particle was 34 times out of the container at the end of a frame"):
        warn_of_misplaced(summary(out_of_container=34))
    with pytest.warns(UserWarning, match="2 times in a solid, 1 times on the other side of a solid"):
        warn_of_misplaced(summary(penetrations=2, crossings=1))


@pytest.mark.parametrize("crossings", [0, None])
def test_a_simulation_in_which_all_is_well_says_nothing(crossings):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_misplaced(summary(crossings=crossings))
