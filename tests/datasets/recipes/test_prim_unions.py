"""Prim-Unions is the data set of section 5.2 of the supplement: all pairs, one shape on top of the other."""

import numpy as np
import pytest

from surfsup.datasets.recipes.extent import extent
from surfsup.datasets.recipes.prim_unions import MAX_HEIGHT, SINK, seat
from surfsup.sdf import polygonize
from tests.datasets.recipes.drawn import assert_valid, scenes

SCENES = scenes("prim-unions", 40)
NUMBERS = pytest.mark.parametrize("index", range(len(SCENES)))


def test_all_ten_pairs_of_different_shapes_alternate():
    pairs = [frozenset(part.kind for part in scene.surface.union) for scene in SCENES]
    assert len(set(pairs[:10])) == 10
    assert all(len(pair) == 2 for pair in pairs)
    assert pairs[:10] == pairs[10:20] == pairs[20:30]


@NUMBERS
def test_every_scene_is_valid(index):
    assert_valid(SCENES[index], particles=(12**3, 15**3))


@NUMBERS
def test_the_upper_shape_is_sunk_into_the_base(index):
    base, upper = SCENES[index].surface.union
    assert base.kind != "cone"
    assert extent(upper)[0][2] == pytest.approx(extent(base)[1][2] - SINK, abs=1e-9)
    lowest, highest = np.min([extent(base)[0], extent(upper)[0]], axis=0), extent(upper)[1]
    assert SCENES[index].surface.scale * (highest[2] - lowest[2]) <= MAX_HEIGHT + 1e-9


@pytest.mark.parametrize("index", range(10))
def test_the_two_are_one_solid_on_the_floor(index):
    mesh = polygonize(SCENES[index].build_surface(), 64)
    assert mesh.body_count == 1
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=0.01)


def test_either_shape_of_a_pair_may_be_the_base():
    kinds = {(scene.surface.union[0].kind, scene.surface.union[1].kind) for scene in SCENES}
    assert len([pair for pair in kinds if pair[::-1] in kinds]) > 4


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("index", [0, 4, 7, 8])
def test_a_seat_is_on_the_base(index, seed):
    import torch

    base = SCENES[index].surface.union[0]
    point = seat(base, np.random.default_rng(seed))
    assert abs(float(base.surface().distance(torch.as_tensor(point[None])))) < 1e-6
