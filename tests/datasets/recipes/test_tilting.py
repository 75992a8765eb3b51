import numpy as np
import pytest

from surfsup.scene import quaternion
from surfsup.scene.solids import build_solids
from tests.datasets.recipes.drawn import round_trip, scenes

SCENES = scenes("tilting", 12)


@pytest.mark.parametrize("index", range(12))
def test_every_scene_starts_at_rest_in_a_container_that_moves(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    start = scene.initial_particles(None)
    assert start.excluded == 0 and 250 < len(start.positions) < 6000
    pose = build_solids(scene).container
    assert np.allclose(pose(0.0).array, [0, 0, 0, 1, 0, 0, 0])
    moved = [pose(0.01 * k) for k in range(150)]
    angles = np.degrees([np.linalg.norm(quaternion.logarithm(one.rotation)) for one in moved])
    shifts = [np.linalg.norm(one.position) for one in moved]
    if index % 3 == 2:
        assert max(angles) == 0 and 0.05 <= max(shifts) <= 0.12
    else:
        assert 4 <= max(angles) <= 30 and max(shifts) == 0


def test_odd_scenes_have_a_dam():
    for index, scene in enumerate(SCENES):
        block = scene.fluid[0].block
        covered = (block.max[0] - block.min[0]) / scene.container.size[0]
        assert (covered < 0.75) == (index % 2 == 1)
