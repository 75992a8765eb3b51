import numpy as np
import pytest

import surfsup as sf
from surfsup.scene.solids import build_solids
from surfsup.scene.start import entering_particles
from surfsup.scene.tap_checks import check_taps_and_drains
from tests.datasets.recipes.drawn import round_trip, scenes

SCENES = scenes("taps", 12)


@pytest.mark.parametrize("index", range(12))
def test_every_scene_has_room_for_its_tap_and_hundreds_of_particles(index):
    scene = round_trip(SCENES[index])
    assert scene.model_dump() == SCENES[index].model_dump()
    solids = build_solids(scene)
    check_taps_and_drains(scene, solids)
    start = scene.initial_particles(solids.still)
    assert start.excluded == 0 and 400 < len(start.positions) + entering_particles(scene) < 6000


def test_every_second_scene_has_a_drain_and_taps_close():
    assert [len(scene.drains) for scene in SCENES] == [0, 1] * 6
    assert all(0.8 <= scene.taps[0].until <= 1.4 for scene in SCENES)


def test_kinds_alternate():
    heights = [np.sign(scene.taps[0].direction[2]) for scene in SCENES[:3]]
    assert SCENES[0].surface_kind == "bowl" and heights == [-1, -1, 1]


def test_a_scene_runs():
    frames = list(sf.Simulation(SCENES[0].with_frames(40)).run())
    assert len(frames[-1].ids) > 0 and np.isfinite(frames[-1].positions).all()
