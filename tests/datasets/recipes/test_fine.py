import pytest
import torch

from tests.datasets.recipes.drawn import points_on_walls, round_trip, scenes

SCENES = scenes("fine", 9)


@pytest.mark.parametrize("index", range(9))
def test_thousands_of_fine_particles_start_clear_of_something_small(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    assert scene.particle_radius == 0.003
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    assert start.excluded == 0 and 3000 < len(start.positions) < 12000
    assert float(surface.distance(torch.from_numpy(start.positions)).min()) > 0.005
    assert float(surface.distance(points_on_walls(scene)).min()) > 0


def test_every_third_solid_is_a_bowl():
    assert [scene.surface_kind == "bowl" for scene in SCENES] == [False, False, True] * 3
