"""Terrain of geographers: ESRI ASCII grids, SRTM tiles, and unknown heights that no one has marked."""

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.sdf import load_heights

GRID = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n1 2 3\n4 5 6.5\n"


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refusal(path) -> str:
    with pytest.raises(InputError) as error:
        load_heights(path)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    "text", [GRID, GRID.upper(), GRID.replace("\n", "\r\n"), GRID.replace("6.5", "6,5"), GRID.replace("3\n4", "3 4")]
)
def test_an_ascii_grid_is_read(tmp_path, text):
    np.testing.assert_array_equal(load_heights(written(tmp_path, "dem.asc", text)), [[1, 2, 3], [4, 5, 6.5]])


def test_a_damaged_or_holed_ascii_grid_is_refused(tmp_path):
    assert "has 5" in refusal(written(tmp_path, "short.asc", GRID.replace(" 6.5", "")))
    assert "damaged" in refusal(written(tmp_path, "text.asc", "Dear all,\nplease find the terrain attached.\n"))
    assert "1 of 6 samples are unknown" in refusal(written(tmp_path, "holes.asc", GRID.replace("6.5", "-9999")))


def test_an_srtm_tile_is_read(tmp_path):
    heights = np.arange(1201 * 1201).reshape(1201, 1201) % 3000
    path = written(tmp_path, "N47E011.hgt", heights.astype(">i2").tobytes())
    np.testing.assert_array_equal(load_heights(path), heights)
    heights[5, 7] = -32768
    assert "1 of 1442401 samples are unknown" in refusal(written(tmp_path, "a.hgt", heights.astype(">i2").tobytes()))
    assert "square" in refusal(written(tmp_path, "b.hgt", bytes(1000)))


@pytest.mark.parametrize(
    ("kind", "void"), [("<f8", -9999), ("<i2", -32768), ("<i4", np.iinfo("i4").min), ("<f4", np.finfo("f4").min)]
)
def test_voids_that_are_not_marked_are_holes(tmp_path, kind, void):
    heights = np.random.default_rng(0).uniform(0, 800, (9, 9)).astype(kind)
    np.save(tmp_path / "whole.npy", heights)
    assert load_heights(tmp_path / "whole.npy").shape == (9, 9)
    heights[2, 3:5] = void
    np.save(tmp_path / "voids.npy", heights)
    assert f"2 of 81 samples are {void:.6g}, which stands for unknown heights" in refusal(tmp_path / "voids.npy")


def test_a_deep_trench_is_no_void(tmp_path):
    np.save(tmp_path / "trench.npy", np.linspace(-9999, 0, 100).reshape(10, 10))
    assert load_heights(tmp_path / "trench.npy").min() == -9999
