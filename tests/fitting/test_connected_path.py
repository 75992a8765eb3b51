"""Interpolation through connected solids only."""

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.fitting.connected_path import evenly_spaced, interpolate_connected, shortest_path
from surfsup.fitting.interpolate import InterpolatedSolid

COARSE = 24


def test_every_solid_is_one_closed_mesh_and_the_ends_are_the_two_shapes(few_shapes):
    steps = list(interpolate_connected(few_shapes, "ball", "plank", 4, COARSE))
    assert len(steps) == 4
    assert all(step.whole for step in steps)
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_a_shape_in_pieces_is_avoided(few_shapes):
    names, start, end = few_shapes.names, 0, 3
    pieces = {
        number: InterpolatedSolid(0.0, None, 2, True) for number in range(len(names)) if number not in (start, end)
    }
    whole = {number: InterpolatedSolid(0.0, None, 1, True) for number in (start, end)}
    assert shortest_path(few_shapes, start, end, {**whole, **pieces}, COARSE) == [start, end]


def test_the_chosen_solids_are_spaced_evenly():
    found = [InterpolatedSolid(float(fraction), None, 1, True) for fraction in np.linspace(0, 1, 21)]
    assert [step.fraction for step in evenly_spaced(found, 5)] == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert [step.fraction for step in evenly_spaced(found[:4] + found[-1:], 5)] == [
        step.fraction for step in found[:4] + found[-1:]
    ]


def test_an_unknown_shape_and_a_single_step_are_refused(few_shapes):
    with pytest.raises(InputError, match="did you mean 'ball'"):
        list(interpolate_connected(few_shapes, "bal", "plank", 4, COARSE))
    with pytest.raises(InputError, match="at least 2"):
        list(interpolate_connected(few_shapes, "ball", "plank", 1, COARSE))
