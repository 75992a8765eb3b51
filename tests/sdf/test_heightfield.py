"""Terrain: every sample is on the surface, north is +y, and unusable files are refused with one line."""

import numpy as np
import pytest
import torch
from PIL import Image, TiffImagePlugin

from surfsup.errors import InputError
from surfsup.sdf import Heightfield, MeshSurface, load_heights
from surfsup.sdf import terrain_file as module
from tests.sdf.solids import points_around

HILLS = np.random.default_rng(0).uniform(0, 900, (7, 9)).round()


def refused(path) -> str:
    with pytest.raises(InputError) as error:
        load_heights(path)
    line = str(error.value)
    assert "\n" not in line
    assert str(path) in line
    return line


def geotiff(path, samples, nodata=None):
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    if nodata is not None:
        tags[42113] = nodata
    Image.fromarray(samples).save(path, tiffinfo=tags)
    return path


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_gray_png_gives_its_samples(tmp_path, dtype):
    samples = (HILLS % 250).astype(dtype)
    Image.fromarray(samples).save(tmp_path / "a.png")
    np.testing.assert_array_equal(load_heights(tmp_path / "a.png"), samples)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.float32])
@pytest.mark.parametrize("suffix", ["tif", "tiff"])
def test_a_geotiff_of_one_band_gives_its_samples(tmp_path, dtype, suffix):
    samples = (HILLS % 250).astype(dtype)
    path = geotiff(tmp_path / f"a.{suffix}", samples, nodata="-9999")
    np.testing.assert_array_equal(load_heights(path), samples)


def test_numpy_files_give_their_only_grid(tmp_path):
    np.save(tmp_path / "a.npy", HILLS)
    np.savez(tmp_path / "a.npz", elevation=HILLS.astype(np.int16), dx=0.1, names=np.array(["a", "b"]))
    np.testing.assert_array_equal(load_heights(tmp_path / "a.npy"), HILLS)
    np.testing.assert_array_equal(load_heights(tmp_path / "a.npz"), HILLS)


@pytest.mark.parametrize(
    ("dtype", "unknown", "tag"),
    [(np.float32, -9999, "-9999"), (np.float32, -3.4028235e38, "-3.4028234663852886e+38"), (np.uint16, 65535, "65535"),
     (np.float32, np.nan, None), (np.float32, np.inf, None)],
)  # fmt: skip
def test_holes_are_counted(tmp_path, dtype, unknown, tag):
    samples = HILLS.astype(dtype)
    samples[2, 3] = samples[4, 4] = unknown
    assert "has holes: 2 of 63 samples are unknown" in refused(geotiff(tmp_path / "a.tif", samples, tag))


def test_files_that_are_no_terrain_are_refused(tmp_path):
    def saved(name, image, **options):
        image.save(tmp_path / name, **options)
        return tmp_path / name

    gray = Image.fromarray((HILLS % 250).astype(np.uint8))
    assert "is not a gray image (its mode is RGB)" in refused(saved("rgb.png", gray.convert("RGB")))
    assert "is not a gray image (its mode is LA)" in refused(saved("alpha.png", gray.convert("LA")))
    assert "is not a gray image (its mode is P)" in refused(saved("palette.png", gray.convert("P")))
    assert "has 1 x 1 samples" in refused(saved("one.png", Image.new("L", (1, 1))))
    assert "has 5 x 1 samples" in refused(saved("line.png", Image.new("L", (1, 5))))
    np.savez(tmp_path / "two.npz", a=HILLS, b=HILLS)
    assert "contains 2 two-dimensional arrays" in refused(tmp_path / "two.npz")
    np.save(tmp_path / "row.npy", HILLS[0])
    assert "contains 0 two-dimensional arrays" in refused(tmp_path / "row.npy")
    np.save(tmp_path / "objects.npy", np.array([[{}]]), allow_pickle=True)
    assert "damaged" in refused(tmp_path / "objects.npy")
    np.savez(tmp_path / "objects.npz", a=np.array([[{}]]))
    assert "damaged" in refused(tmp_path / "objects.npz")
    assert "check the path" in refused(tmp_path / "missing.png")
    assert "ends in .png" in refused(tmp_path / "a.jpg")
    for name in ("a.png", "a.tif", "a.npz", "a.npy"):
        (tmp_path / name).write_bytes(b"not a terrain")
        assert "damaged" in refused(tmp_path / name)
        (tmp_path / name).write_bytes(b"")
        assert "damaged" in refused(tmp_path / name)


def test_a_truncated_image_is_refused(tmp_path):
    noise = np.random.default_rng(0).integers(0, 255, (200, 200)).astype(np.uint8)
    Image.fromarray(noise).save(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(whole[: len(whole) // 2])
    assert "damaged" in refused(tmp_path / "a.png")


def test_a_huge_image_is_refused_before_it_is_unpacked(tmp_path):
    Image.new("L", (10_000, 5_001)).save(tmp_path / "huge.png")
    assert "has 50,010,000 samples, more than 50,000,000" in refused(tmp_path / "huge.png")


def test_a_huge_archive_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MAX_FILE_SAMPLES", 1000)
    np.savez_compressed(tmp_path / "huge.npz", a=np.zeros((100, 100)))
    assert "more than 1,000" in refused(tmp_path / "huge.npz")


def test_more_samples_than_a_surface_can_have_are_refused():
    with pytest.raises(InputError, match=r"dem: has 1500 x 1001 samples, .* reduce it to 1224 along each side"):
        Heightfield(np.zeros((1500, 1001)), (1, 1), 1, 1, source="dem")


def test_the_solid_is_closed_and_every_sample_is_a_vertex():
    mesh = Heightfield(HILLS, (3.0, 2.0), height=0.5, base=0.2).to_mesh()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    np.testing.assert_allclose(mesh.bounds, [[-1.5, -1, 0], [1.5, 1, 0.7]])
    top = mesh.vertices[: HILLS.size].reshape(7, 9, 3)
    np.testing.assert_allclose(top[..., 2], 0.2 + 0.5 * (HILLS - HILLS.min()) / np.ptp(HILLS))
    assert top[0, 0, :2].tolist() == [-1.5, 1.0]  # north-west
    assert top[-1, -1, :2].tolist() == [1.5, -1.0]
    # The volume is between those of splitting all squares along the lower and along the higher diagonal.
    cell, levels = 3.0 / 8 * 2.0 / 6, top[..., 2]
    means = (levels[:-1, :-1] + levels[1:, :-1] + levels[:-1, 1:] + levels[1:, 1:]) / 4
    assert mesh.volume == pytest.approx(cell * means.sum(), rel=0.1)


def test_a_plane_slope_has_its_exact_distance():
    slope = np.tile(np.arange(20.0), (20, 1))  # rises eastward
    surface = Heightfield(slope, (2.0, 2.0), height=1.0, base=0.1)
    points = torch.tensor([[0.0, 0.0, 0.8], [0.3, -0.2, 0.85], [0.0, 0.0, 0.5]], dtype=torch.float64)
    level = 0.6 + 0.5 * points[:, 0]
    true = (points[:, 2] - level) * (2.0 / np.hypot(2.0, 1.0))
    distance, normal = surface.distance_and_normal(points)
    torch.testing.assert_close(distance, true)
    up = torch.tensor([-0.5, 0.0, 1.0], dtype=torch.float64).expand(3, 3)
    torch.testing.assert_close(normal, torch.nn.functional.normalize(up))


def test_distance_and_normal_are_those_of_the_closed_mesh():
    terrain = Heightfield(HILLS, (0.8, 0.6), height=0.3, base=0.1)
    mesh = MeshSurface(terrain.to_mesh(), exact=True)
    points = points_around(terrain, count=3000)
    for found, true in zip(terrain.distance_and_normal(points), mesh.distance_and_normal(points), strict=True):
        torch.testing.assert_close(found, true)
    distance = terrain.distance(points)
    assert (distance < 0).sum() > 200


def test_the_gradient_in_the_points_is_the_normal():
    terrain = Heightfield(HILLS, (0.8, 0.6), height=0.3, base=0.1)
    points = points_around(terrain, count=50).requires_grad_()
    distance, normal = terrain.distance_and_normal(points)
    (gradient,) = torch.autograd.grad(distance.sum(), points)
    torch.testing.assert_close(gradient, normal)
    step = 1e-6 * normal.detach()
    slope = (terrain.distance(points + step) - terrain.distance(points - step)) / 2e-6
    assert ((slope - 1).abs() < 1e-3).double().mean() > 0.95  # except beside the medial axis


def test_a_level_terrain_is_a_slab():
    mesh = Heightfield(np.full((3, 4), 7.0), (1.0, 2.0), height=0.5, base=0.2).to_mesh()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.4)
