import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.fitting.point_cloud import is_cloud, load_cloud

HEADER = "ply\nformat ascii 1.0\nelement vertex {}\n{}end_header\n"
POSITION = "property float x\nproperty float y\nproperty float z\n"
NORMAL = "property float nx\nproperty float ny\nproperty float nz\n"


@pytest.fixture
def sphere() -> np.ndarray:
    normals = np.random.default_rng(0).normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([2 * normals, 3 * normals], axis=1)


def write_ply(path, rows, properties=POSITION + NORMAL):
    lines = "\n".join(" ".join(map(str, row)) for row in rows)
    path.write_text(HEADER.format(len(rows), properties) + lines + "\n")
    return path


def test_xyz_and_ply_give_the_same_points_and_unit_normals(sphere, tmp_path):
    text = tmp_path / "ball.xyz"
    text.write_text("# x y z nx ny nz\n\n" + "\n".join(" ".join(map(str, row)) for row in sphere))
    for path in (text, write_ply(tmp_path / "ball.ply", sphere)):
        assert is_cloud(path)
        cloud = load_cloud(path)
        np.testing.assert_allclose(cloud.points, sphere[:, :3], atol=1e-6)
        np.testing.assert_allclose(cloud.normals, sphere[:, 3:] / 3, atol=1e-6)


def test_a_ply_with_triangles_is_not_a_cloud(tmp_path):
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(1).export(path)
    assert not is_cloud(path)
    assert not is_cloud(tmp_path / "ball.obj")


def test_points_without_normals_are_refused_with_a_remedy(sphere, tmp_path):
    text = tmp_path / "ball.xyz"
    text.write_text("\n".join(" ".join(map(str, row[:3])) for row in sphere))
    for path in (text, write_ply(tmp_path / "ball.ply", sphere[:, :3], POSITION)):
        with pytest.raises(InputError, match=r"have no normals .*estimate_normals"):
            load_cloud(path)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda rows: rows[:0], "has no points"),
        (lambda rows: rows[:20], "has 20 points; give a cloud of at least 100"),
        (lambda rows: rows * [1, 1, 0, 1, 1, 1], "is flat, so it has no inside"),
        (lambda rows: rows * [1, 1, 1, 0, 0, 0], "300 of its normals are zero"),
        (lambda rows: np.where(np.arange(6) == 1, np.nan, rows), "not finite"),
    ],
)
def test_a_cloud_without_an_inside_is_refused(sphere, tmp_path, change, complaint):
    with pytest.raises(InputError, match=complaint):
        load_cloud(write_ply(tmp_path / "cloud.ply", change(sphere)))


@pytest.mark.parametrize(("text", "complaint"), [("1 2 x 4 5 6", "line 1 is not six"), ("1 2", "line 1 is not six")])
def test_a_malformed_line_is_named(tmp_path, text, complaint):
    path = tmp_path / "cloud.xyz"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        load_cloud(path)


def test_a_missing_or_damaged_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_cloud(tmp_path / "none.xyz")
    (tmp_path / "cut.ply").write_text("ply\nformat ascii 1.0\nelement vertex 5\n")
    with pytest.raises(InputError, match="damaged or is no PLY"):
        load_cloud(tmp_path / "cut.ply")
    (tmp_path / "noise.xyz").write_bytes(bytes(range(128, 256)))
    with pytest.raises(InputError, match="cannot be read as text"):
        load_cloud(tmp_path / "noise.xyz")
