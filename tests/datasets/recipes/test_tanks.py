"""Tanks are water on the floor of an empty container, from which the solver can start."""

import numpy as np
import pytest

from tests.datasets.recipes.drawn import round_trip, scenes

SCENES = scenes("tanks", 40)


@pytest.mark.parametrize("index", range(40))
def test_every_scene_is_valid(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    start = scene.initial_particles(None)
    assert start.excluded == 0
    assert 200 < len(start.positions) < 6500
    gap = min((start.positions - scene.container.lower).min(), (scene.container.upper - start.positions).min())
    assert gap > 0.049, "closer to several walls the water bursts"


def test_even_scenes_cover_the_floor_and_depths_vary():
    for scene in SCENES[::2]:
        block, sides = scene.fluid[0].block, scene.container.size
        assert sides[0] - (block.max[0] - block.min[0]) == pytest.approx(0.04)
        assert sides[1] - (block.max[1] - block.min[1]) == pytest.approx(0.04)
    depths = [scene.fluid[0].block.max[2] - scene.fluid[0].block.min[2] for scene in SCENES]
    assert min(depths) < 0.3
    assert max(depths) > 0.7
    free = [
        scene.container.size[0] - np.ptp([scene.fluid[0].block.min[0], scene.fluid[0].block.max[0]]) for scene in SCENES
    ]
    assert max(free[1::2]) > 0.2
