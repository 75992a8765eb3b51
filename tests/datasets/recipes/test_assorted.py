"""Assorted scenes are valid and vary everything that the other recipes keep fixed."""

import numpy as np
import pytest
import torch

from surfsup.datasets.recipes.assorted import ATTEMPTS, SOLID_GAP, free_block, is_clear
from surfsup.scene import Block, Container
from surfsup.sdf import Box
from tests.datasets.recipes.drawn import round_trip, scenes

SCENES = scenes("assorted", 60)


@pytest.mark.parametrize("index", range(60))
def test_every_scene_is_valid(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    assert start.excluded == 0
    assert 200 <= len(start.positions) <= 10_000
    if surface is not None:
        with torch.no_grad():
            assert float(surface.distance(torch.from_numpy(start.positions)).min()) > SOLID_GAP


def test_every_sixth_scene_has_no_solid():
    assert [scene.surface is None for scene in SCENES] == [index % 6 == 5 for index in range(60)]


def test_container_gravity_velocity_and_blocks_vary():
    assert np.ptp([scene.container.size[0] for scene in SCENES]) > 0.4
    strength = [np.linalg.norm(scene.gravity) for scene in SCENES]
    assert min(strength) < 7
    assert max(strength) > 12
    assert 10 < sum(abs(scene.gravity[0]) > 1e-3 for scene in SCENES) < 30
    assert {len(scene.fluid) for scene in SCENES} == {1, 2}
    thrown = [any(entry.block.velocity != (0, 0, 0) for entry in scene.fluid) for scene in SCENES]
    assert 20 < sum(thrown) < 55


def test_a_block_near_a_solid_is_not_clear():
    assert not is_clear(Block(min=(0, 0, 1), max=(0.3, 0.3, 1.3)), Box((0.5, 0.5, 2.04)))
    assert is_clear(Block(min=(0, 0, 1), max=(0.3, 0.3, 1.3)), Box((0.5, 0.5, 1.9)))


def test_without_room_there_is_no_second_block():
    small = Container(size=(0.62, 0.62, 0.65))
    blocks = [Block((-0.3, -0.3, 0.01), (0.3, 0.3, 0.6))]
    assert free_block(small, None, blocks, np.random.default_rng(ATTEMPTS)) == []
