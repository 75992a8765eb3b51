import math

import pytest
import torch

from surfsup.sph.long_steps import LONG_STEP, MAX_PART_PATH, parts_of_step, relative_speed
from surfsup.sph.state import SUBSTEP_TIME, ParticleState

GRAVITY = torch.tensor([0.0, 0.0, -9.81])


def water(depth: float, speed: float = 0.0, drift: float = 0.0) -> ParticleState:
    """A column of ``depth`` whose particles move by ``speed`` in both directions, and ``drift`` together."""
    positions = torch.zeros(1000, 3)
    positions[:, 2] = torch.linspace(0, depth, 1000)
    velocities = torch.zeros(1000, 3)
    velocities[::2, 0], velocities[1::2, 0] = drift + speed, drift - speed
    return ParticleState(positions, velocities)


def substeps_of(state: ParticleState) -> int:
    return sum(part.substeps for part in parts_of_step(state, GRAVITY))


def test_shallow_water_at_rest_takes_three_substeps():
    (part,) = parts_of_step(water(0.06), GRAVITY)
    assert (part.seconds, part.substeps) == (LONG_STEP, 3)


def test_substeps_are_inverse_to_the_depth_of_water_at_rest():
    shallow, deep = substeps_of(water(0.2)), substeps_of(water(0.4))
    assert shallow == math.ceil(0.1 * 9.81 * LONG_STEP / 2e-3)
    assert deep in (2 * shallow - 1, 2 * shallow)


@pytest.mark.parametrize(("speed", "parts"), [(0.0, 1), (1.2, 1), (1.4, 2), (3.0, 3), (4.0, 4), (14.0, 4)])
def test_fast_water_searches_its_neighbors_more_often(speed, parts):
    found = parts_of_step(water(0.0, speed=speed), GRAVITY)
    assert len(found) == parts and len(set(found)) == 1
    assert sum(part.seconds for part in found) == pytest.approx(LONG_STEP)
    assert speed > 5 or speed * found[0].seconds <= MAX_PART_PATH


def test_water_moves_at_most_a_quarter_of_a_spacing_in_a_substep():
    (part, *_) = parts_of_step(water(0.0, speed=3.0), GRAVITY)
    assert 0.6 * 7.5e-3 <= 3.0 * part.seconds / part.substeps <= 7.5e-3


def test_water_that_moves_as_a_whole_may_strike_and_counts_as_fast():
    assert substeps_of(water(0.0, drift=3.0)) == substeps_of(water(0.0, speed=3.0))


def test_only_depth_along_gravity_counts():
    upright = water(0.5)
    lying = ParticleState(upright.positions[:, [2, 0, 1]], upright.velocities)
    assert substeps_of(lying) == 3
    assert substeps_of(upright) > 6
    assert [part.substeps for part in parts_of_step(upright, torch.zeros(3))] == [3]


@pytest.mark.parametrize("speed", [9.0, 1e6, float("inf"), float("nan")])
def test_no_substep_is_shorter_than_those_of_the_default(speed):
    for part in parts_of_step(water(0.1, speed=speed), GRAVITY):
        assert part.seconds / part.substeps == pytest.approx(SUBSTEP_TIME)


def test_the_relative_speed_is_that_beside_the_mean():
    assert relative_speed(water(0.2, speed=0.7, drift=5.0).velocities) == pytest.approx(0.7, rel=1e-4)
