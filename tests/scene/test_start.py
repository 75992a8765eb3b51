import re

import pytest

from surfsup.errors import InputError
from surfsup.memory import available_memory
from surfsup.scene import Block, Container, Scene
from surfsup.scene.start import BYTES_PER_PARTICLE, round_up


def test_more_particles_than_memory_holds_are_refused_with_a_radius_that_fits():
    side = 0.003 * (20 * available_memory() / BYTES_PER_PARTICLE) ** (1 / 3)
    if (side / 0.003) ** 3 > 4e7 * 8:
        side = 0.003 * 4e7 ** (1 / 3)
    block = Block((-side / 2, -side / 2, 0.1), (side / 2, side / 2, 0.1 + side))
    many = [block] * 40
    scene = Scene(fluid=many, container=Container(size=(2 * side, 2 * side, 2 * side)), particle_radius=0.0015)
    with pytest.raises(InputError, match=r"gives [\d,]+ particles, but this machine has memory for some") as error:
        scene.initial_particles(None)
    found = re.search(r"with (\S+) m they would fit", str(error.value))
    assert found and float(found[1]) > scene.particle_radius
    fitting = scene.with_changes(particle_radius=float(found[1]))
    count = sum((side / fitting.spacing - 1) ** 3 for _ in many)
    assert count * BYTES_PER_PARTICLE < 1.1 * available_memory()


def test_rounding_up_keeps_two_digits():
    assert round_up(0.00312) == pytest.approx(0.0032)
    assert round_up(0.05) == pytest.approx(0.05)
    assert round_up(0.0999) == pytest.approx(0.1)


TILTED = (
    "container: {size: [0.6, 0.6, 0.8], motion: {keyframes: [{time: 0, position: [2, 0, 0],"
    " rotation: {axis: [0, 1, 0], degrees: 30}}, {time: 0.1}]}}\nfluid: [%s]"
)


MESSAGE = r"outside the container.*moved by \(2, 0, 0\) m and rotated by 30 degrees"


def particles_of(entry: str) -> int:
    return len(Scene.from_yaml(TILTED % entry, "test").initial_particles(None).positions)


def test_a_block_is_checked_against_the_container_where_it_begins():
    assert particles_of("{block: {min: [2.1, -0.1, 0.2], max: [2.3, 0.1, 0.4]}}") > 50
    with pytest.raises(InputError, match=MESSAGE):
        particles_of("{block: {min: [-0.1, -0.1, 0.2], max: [0.1, 0.1, 0.4]}}")
    with pytest.raises(InputError, match=MESSAGE):  # inside if the container were not rotated
        particles_of("{block: {min: [1.75, -0.1, 0.02], max: [1.9, 0.1, 0.2]}}")


def test_a_fill_is_checked_against_the_container_where_it_begins():
    box = "{fill: {surface: {box: {size: [0.2, 0.2, 0.2]}, at: [%g, 0, 0.3]}}}"
    assert particles_of(box % 2.2) > 50
    with pytest.raises(InputError, match=MESSAGE):
        particles_of(box % 0)
