import numpy as np

from surfsup.sdf import Sphere
from surfsup.sph.boundary.volume_map import build_volume_map
from surfsup.splishsplash.map_file import write_map


def test_the_file_has_the_layout_of_discregrid(tmp_path):
    volume_map = build_volume_map(
        Sphere(0.1), np.array([-0.2, -0.25, -0.2]), np.array([0.2, 0.25, 0.3]), np.full(3, 0.05)
    )
    write_map(tmp_path / "ball.cdm", volume_map)
    data = (tmp_path / "ball.cdm").read_bytes()
    offset = 0

    def take(form: str, count: int = 1) -> np.ndarray:
        nonlocal offset
        values = np.frombuffer(data, dtype=form, count=count, offset=offset)
        offset += values.nbytes
        return values

    np.testing.assert_allclose(take("<f8", 6), [-0.2, -0.25, -0.2, 0.2, 0.25, 0.3])
    np.testing.assert_array_equal(take("<u4", 3), [8, 10, 10])
    np.testing.assert_allclose(take("<f8", 6), [0.05] * 3 + [20] * 3)
    assert list(take("<u8", 2)) == [800, 2]
    assert take("<u8") == 2
    for values in (volume_map.distances, volume_map.volumes):
        (count,) = take("<u8")
        np.testing.assert_array_equal(take("<f8", count), values.astype(np.float64))
    assert take("<u8") == 2
    (cells,) = take("<u8")
    np.testing.assert_array_equal(take("<u4", 32 * cells).reshape(-1, 32), volume_map.cell_nodes)
    assert take("<u8") == 0
    assert take("<u8") == 2
    for _ in range(2):
        (count,) = take("<u8")
        indices = take("<u4", count)
        np.testing.assert_array_equal(np.flatnonzero(indices != 0xFFFFFFFF), np.sort(volume_map.cells))
        np.testing.assert_array_equal(indices[volume_map.cells], np.arange(cells))
    assert offset == len(data)
