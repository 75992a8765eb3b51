"""The dragon of ``examples/honey.yaml`` is one closed animal, and the file in ``examples/`` is that animal."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from surfsup.datasets.procedural.dragon import CELL, dragon, simplified

FILE = Path(__file__).parents[3] / "examples" / "dragon.obj"


@pytest.fixture(scope="module")
def sculpted():
    return dragon()


def test_it_is_one_closed_solid_that_stands_on_the_floor(sculpted):
    assert sculpted.is_watertight and sculpted.is_winding_consistent and sculpted.body_count == 1
    assert abs(sculpted.bounds[0, 2]) < CELL


def test_the_file_is_the_dragon_with_fewer_triangles(sculpted):
    pytest.importorskip("pyvista")
    file, simple = trimesh.load_mesh(FILE), simplified(sculpted, 9000)
    assert file.is_watertight and len(file.faces) == 9000
    np.testing.assert_allclose(file.bounds, simple.bounds, atol=1e-3)
    np.testing.assert_allclose([file.volume, simple.volume], sculpted.volume, rtol=0.01)
