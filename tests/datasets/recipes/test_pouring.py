import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup.native.dispatch import is_built
from surfsup.scene.solids import build_solids
from tests.datasets.recipes.drawn import points_on_walls, round_trip, scenes

SCENES = scenes("pouring", 8)


@pytest.mark.parametrize("index", range(8))
def test_the_water_begins_in_the_cup_which_turns_clear_of_the_catcher_and_the_walls(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    solids = build_solids(scene)
    (cup,) = solids.moving
    start = scene.initial_particles(solids.at_time(0.0))
    assert start.excluded == 0 and 400 < len(start.positions) < 2500
    own = cup.pose(0.0).to_own(start.positions)
    assert np.abs(own[:, :2]).max() < 0.25 and own[:, 2].max() < 0.22
    vertices = cup.surface.to_mesh(48).vertices
    for time in np.linspace(0, 1.2, 13):
        placed = cup.pose(time).apply(vertices).astype(np.float32)
        assert float(solids.still.distance(torch.from_numpy(placed)).min()) > 0.02
        assert (placed > scene.container.lower).all() and (placed < scene.container.upper).all()
    assert float(solids.still.distance(points_on_walls(scene)).min()) > 0


def test_cups_and_catchers_alternate():
    kinds = [(scene.surfaces["cup"].union[0].difference[0].kind, scene.surfaces["catcher"].kind) for scene in SCENES]
    assert kinds[:4] == [("cylinder", "bowl"), ("box", "bowl"), ("cylinder", "difference"), ("box", "difference")]


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_most_of_the_water_is_poured_into_the_catcher():
    scene = SCENES[1]
    frames = list(sf.Simulation(scene).run())
    bowl, end = scene.surfaces["catcher"], frames[-1].positions
    assert len(end) == len(frames[0].positions)
    assert (end[:, 2] < frames[0].positions[:, 2].min()).mean() > 0.9
    inside = (np.hypot(end[:, 0], end[:, 1]) < bowl.bowl.capture_radius) & (end[:, 2] > 0.05)
    assert inside.mean() > 0.6
