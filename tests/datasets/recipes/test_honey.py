import pytest
import torch

from tests.datasets.recipes.drawn import round_trip, scenes

SCENES = scenes("honey", 10)


@pytest.mark.parametrize("index", range(10))
def test_every_scene_is_a_viscous_block_clear_of_its_solid(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    assert scene.frames == 300 and scene.liquid.density == 1000
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    assert start.excluded == 0 and float(surface.distance(torch.from_numpy(start.positions)).min()) > 0.04


def test_viscosities_span_the_range_and_every_second_liquid_slips():
    viscosities = [scene.liquid.viscosity for scene in SCENES]
    assert 0.03 < min(viscosities) < 0.1 and 0.3 < max(viscosities) < 1
    assert [scene.liquid.friction for scene in SCENES[:4]] == [1, 0, 1, 0]
