"""From one shape to another through whole solids only."""

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.fitting.interpolate import Between
from surfsup.fitting.way import path_of, spread, whole_way

COARSE = 24


def test_every_step_is_one_closed_mesh_and_the_ends_are_the_two_shapes(few_shapes):
    steps = list(whole_way(few_shapes, "ball", "plank", 4, COARSE))
    assert len(steps) == 4
    assert all(step.whole for step in steps)
    shares = [step.share for step in steps]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)


def test_a_shape_in_pieces_is_gone_around(few_shapes):
    names, start, end = few_shapes.names, 0, 3
    pieces = {number: Between(0.0, None, 2, True) for number in range(len(names)) if number not in (start, end)}
    whole = {number: Between(0.0, None, 1, True) for number in (start, end)}
    assert path_of(few_shapes, start, end, {**whole, **pieces}, COARSE) == [start, end]


def test_steps_are_spread_evenly_over_what_was_found():
    found = [Between(float(share), None, 1, True) for share in np.linspace(0, 1, 21)]
    assert [step.share for step in spread(found, 5)] == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert [step.share for step in spread(found[:4] + found[-1:], 5)] == [step.share for step in found[:4] + found[-1:]]


def test_a_shape_that_is_not_there_and_a_single_step_are_refused(few_shapes):
    with pytest.raises(InputError, match="did you mean 'ball'"):
        list(whole_way(few_shapes, "bal", "plank", 4, COARSE))
    with pytest.raises(InputError, match="at least 2"):
        list(whole_way(few_shapes, "ball", "plank", 1, COARSE))
