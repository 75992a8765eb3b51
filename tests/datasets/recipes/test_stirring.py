import numpy as np
import pytest
import torch

from surfsup.scene import FRAME_TIME
from surfsup.scene.solids import build_solids
from tests.datasets.recipes.drawn import points_on_walls, round_trip, scenes

SCENES = scenes("stirring", 12)


@pytest.mark.parametrize("index", range(12))
def test_every_scene_starts_clear_of_its_paddle_and_the_paddle_stays_in_the_container(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    solids = build_solids(scene)
    (paddle,) = solids.moving
    start = scene.initial_particles(solids.at_time(0.0))
    assert start.excluded == 0 and 1000 < len(start.positions) < 5000
    assert float(solids.at_time(0.0).distance(torch.from_numpy(start.positions)).min()) > 0.04
    walls = points_on_walls(scene)
    for frame in (0, 50, 100):
        solid = solids.at({"paddle": paddle.pose(frame * FRAME_TIME)})
        assert float(solid.distance(walls).min()) > 0


def test_paddles_turn_both_ways():
    rates = [scene.surfaces["paddle"].motion.spin.rate for scene in SCENES]
    assert min(rates) < -2 and max(rates) > 2 and np.abs(rates).max() < 8
