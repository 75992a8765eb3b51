import numpy as np
import pytest

from surfsup.datasets.recipes import prim_shapes
from surfsup.datasets.generate import recipe_scene
from surfsup.errors import InputError
from surfsup.sdf import polygonise

SCENES = [recipe_scene("prim-shapes", 3, index) for index in range(25)]
KINDS = ["sphere", "box", "cylinder", "cone", "torus"]
# A turned box stands on a corner, which the coarse mesh that its extent is read from cuts off.
CORNER = 0.02


def test_the_same_seed_and_number_is_the_same_scene():
    assert recipe_scene("prim-shapes", 3, 7) == SCENES[7]
    assert recipe_scene("prim-shapes", 3, 2).to_yaml() == SCENES[2].to_yaml()


def test_another_seed_number_or_attempt_is_another_scene():
    others = [
        ("prim-shapes", 4, 7),
        ("prim-shapes", 3, 12),
        ("prim-shapes", 3, 7, 1),
        ("prim-shapes", 3, 7, 2),
    ]
    texts = {recipe_scene(*arguments).to_yaml() for arguments in others} | {SCENES[7].to_yaml()}
    assert len(texts) == 5


def test_an_unknown_recipe_or_a_negative_seed_is_one_line():
    with pytest.raises(InputError, match=r"no recipe 'prim'; known are prim-shapes"):
        recipe_scene("prim", 0, 0)
    with pytest.raises(InputError, match="seed is -1"):
        recipe_scene("prim-shapes", -1, 0)


def test_the_five_shapes_take_turns():
    assert [scene.surface.kind for scene in SCENES[:10]] == KINDS * 2


def test_sizes_are_in_the_supplements_ranges():
    for draw in range(200):
        random = np.random.default_rng(draw)
        sphere, box, cylinder, cone, torus = (next(iter(shape(random).values())) for shape in prim_shapes.SHAPES)
        assert 0.25 <= sphere.radius <= 0.5
        assert all(0.4 <= side <= 0.7 for side in box.size)
        assert 0.15 <= cylinder.radius <= 0.35
        assert 0.4 <= cylinder.height <= 0.75
        assert 0.4 <= cone.height <= 0.7
        assert 0.2 <= cone.bottom_radius <= 0.4
        assert cone.top_radius == 0.01
        assert 0.2 <= torus.major_radius <= 0.4
        assert torus.major_radius / 4 <= torus.minor_radius <= 3 * torus.major_radius / 4


@pytest.mark.parametrize("index", range(25))
def test_the_shape_stands_on_the_floor_between_the_walls_and_the_water_is_above(index):
    scene = SCENES[index]
    lower, upper = polygonise(scene.build_surface(), 100).bounds
    assert -CORNER < lower[2] <= 1e-3
    for axis in (0, 1):
        if upper[axis] - lower[axis] <= 1 - CORNER:
            assert lower[axis] > -0.5 - CORNER
            assert upper[axis] < 0.5 + CORNER
        else:  # too wide: in the middle
            assert abs(lower[axis] + upper[axis]) < 2 * CORNER
    block = scene.fluid[0].block
    sides = np.subtract(block.max, block.min)
    assert (sides >= 0.4 - 1e-9).all()
    assert (sides <= 0.5 + 1e-9).all()
    assert (np.array(block.min) >= scene.container.lower).all()
    assert (np.array(block.max) <= scene.container.upper).all()
    gap = block.min[2] - upper[2]
    assert gap > 0.05 - CORNER
    assert gap < 0.65 + CORNER


@pytest.mark.parametrize("index", range(5))
def test_no_particle_is_left_out_and_there_are_as_many_as_the_supplement_says(index):
    start = SCENES[index].start(SCENES[index].build_surface())
    assert start.left_out == 0
    assert 12**3 <= len(start.positions) <= 15**3


@pytest.mark.parametrize(
    ("lower", "upper", "expected"), [(-0.1, 0.3, (-0.4, 0.2)), (-0.5, 0.5, (0, 0)), (-0.8, 0.6, (0.1, 0.1))]
)
def test_room_is_where_a_shape_stays_between_the_walls(lower, upper, expected):
    assert prim_shapes.room(lower, upper, 1.0) == pytest.approx(expected)
