"""The coral, the lion and the room are closed, connected, detailed and reproducible."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from surfsup.datasets.procedural.coral import CELL, TIP_RADIUS, branch_radii, coral, grow
from surfsup.datasets.procedural.dragon import dragon, simplified
from surfsup.datasets.procedural.lion import lion
from surfsup.datasets.procedural.room import FLOOR, HALF, HIGH, room
from surfsup.scene import Shape
from surfsup.sdf import polygonize

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module", params=[coral, lion])
def statue(request):
    return request.param()


def test_a_statue_is_one_closed_solid_of_the_right_size(statue):
    assert statue.is_watertight
    assert statue.is_winding_consistent
    assert statue.body_count == 1
    assert statue.volume > 0.1
    assert 50_000 < len(statue.faces) < 100_000
    assert 1.8 < statue.extents.max() < 2.1
    assert abs(statue.bounds[0, 2]) < CELL  # it stands on the floor


def test_a_statue_has_far_more_area_than_a_ball_of_its_volume(statue):
    ball = 4 * np.pi * (3 * statue.volume / (4 * np.pi)) ** (2 / 3)
    assert statue.area > 1.9 * ball


@pytest.mark.parametrize("make", [coral, lion])
def test_a_statue_is_reproducible(make):
    first, second = make(), make()
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)


def test_another_seed_grows_another_coral():
    first, second = grow(np.random.default_rng(0))[0], grow(np.random.default_rng(1))[0]
    assert first.shape != second.shape or not np.allclose(first, second)


def test_the_corals_fingers_are_thin_at_the_tips_and_thicker_below():
    nodes, parents = grow(np.random.default_rng(0))
    radii = branch_radii(parents)
    tips = np.setdiff1d(np.arange(len(nodes)), parents)
    assert len(tips) > 60
    np.testing.assert_allclose(radii[tips], TIP_RADIUS)
    later = parents >= 0
    assert (radii[later] <= radii[parents[later]] + 1e-12).all()
    assert (parents < np.arange(len(parents))).all()
    inner = np.linalg.norm(nodes[later] - nodes[parents[later]], axis=1)
    np.testing.assert_allclose(inner, 0.05, atol=1e-9)


def pieces(shape: Shape) -> list[Shape]:
    return [shape] if shape.union is None else [piece for part in shape.union for piece in pieces(part)]


def test_the_room_has_furniture_and_no_part_is_too_thin():
    parts = pieces(room())
    assert len(parts) > 60
    for piece in parts:
        if piece.box is not None:
            assert min(piece.box.size) >= 0.035
        elif piece.cylinder is not None:
            assert min(2 * piece.cylinder.radius, piece.cylinder.height) >= 0.035


def test_the_room_is_one_solid_with_an_open_top():
    surface = room().surface()
    np.testing.assert_allclose(surface.bounds().numpy(), [[-HALF, -HALF, 0], [HALF, HALF, HIGH]], atol=1e-6)
    assert polygonize(surface, 100).body_count == 1
    above = torch.tensor([[x, y, HIGH + 0.05] for x in np.linspace(-0.8, 0.8, 9) for y in np.linspace(-0.8, 0.8, 9)])
    assert (surface.distance(above.float()) > 0.04).all()
    assert float(surface.distance(torch.tensor([[0.0, -0.7, FLOOR + 0.1]]))) == pytest.approx(0.1, abs=1e-5)


def test_the_room_can_be_imported_before_any_recipe():
    subprocess.run([sys.executable, "-c", "import surfsup.datasets.procedural.room"], check=True)


def test_the_dragon_is_one_closed_solid_on_the_floor():
    statue = dragon()
    assert statue.is_watertight
    assert statue.body_count == 1
    assert abs(statue.bounds[0, 2]) < 0.007
    coarse = simplified(statue, 9000)
    assert coarse.is_watertight
    assert len(coarse.faces) <= 9000
    assert coarse.volume == pytest.approx(statue.volume, rel=0.01)
    np.testing.assert_allclose(coarse.bounds, statue.bounds, atol=0.01)


def test_the_dragon_that_ships_is_closed():
    shipped = trimesh.load(EXAMPLES / "dragon.obj")
    assert shipped.is_watertight
    assert len(shipped.faces) == 9000
