import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.fitting.deepsdf_fit import (
    CLAMP,
    CUBE_SAMPLES,
    clamped_error,
    load_samples,
    sample_shape,
    sample_shapes,
    save_samples,
)
from surfsup.fitting.exact_shape import ExactSurface
from surfsup.fitting.interpolate import interpolate
from surfsup.fitting.reconstruct import reconstruct
from surfsup.fitting.shape_set import open_shape_set
from surfsup.sdf import Box
from tests.fitting.conftest import Balls


def test_most_samples_are_near_the_surface():
    _, distance = sample_shape(ExactSurface(Box((0.5, 0.5, 0.5))), np.random.default_rng(0))
    assert (distance.abs() < 0.1).float().mean() > 0.75
    assert len(distance) > 8 * CUBE_SAMPLES


def test_differences_beyond_the_clamp_have_no_error():
    far = torch.tensor([0.3, -0.3])
    assert float(clamped_error(far, torch.tensor([5.0, -5.0]))) == 0
    assert float(clamped_error(far, -far)) == pytest.approx(2 * CLAMP)


def test_every_fitted_shape_has_its_distances(few_shapes):
    balls = Balls()
    for name in few_shapes.names:
        near = balls.shape(name).sample_near(2000, np.random.default_rng(5))
        surface = few_shapes.surface(few_shapes.code(name))
        value = surface.distance(torch.from_numpy(near.points).float()).numpy()
        assert np.abs(value - near.distance).mean() < 0.025


def test_an_unseen_shape_is_reconstructed_by_its_code(few_shapes):
    unseen = ExactSurface(Box((0.6, 0.35, 0.4)))
    points, distance = sample_shape(unseen, np.random.default_rng(1))
    found = reconstruct(few_shapes, points, distance)
    assert found.code.shape == (4,)
    assert found.nearest in ("brick", "plank")
    started = few_shapes.code(found.nearest)
    with torch.no_grad():
        before = clamped_error(few_shapes.network.value(points[None], started[None])[0], distance)
    assert found.error < float(before)


def test_an_interpolation_starts_and_ends_at_the_two_shapes(few_shapes):
    first, second = few_shapes.code("cube"), few_shapes.code("plank")
    steps = list(interpolate(few_shapes, first, second, 3, resolution=40))
    assert [step.fraction for step in steps] == [0, 0.5, 1]
    volumes = [step.mesh.volume for step in steps]
    assert volumes[0] > volumes[1] > volumes[2]
    assert all(step.whole for step in steps)
    with pytest.raises(InputError, match="at least 2"):
        next(interpolate(few_shapes, first, second, 1))


def test_saved_samples_are_loaded_unchanged(tmp_path):
    samples = sample_shapes(Balls(), 0, lambda done, total: None)
    save_samples(tmp_path, samples)
    back = load_samples(tmp_path)
    assert back.names == samples.names
    assert torch.equal(back.points, samples.points)
    with pytest.raises(InputError, match="no such file"):
        load_samples(tmp_path / "elsewhere")


def test_procedural_shapes_follow_from_their_numbers():
    for source in ("chairs", "bowls"):
        shapes = open_shape_set(source, None, 3)
        assert len(shapes.names) == 3
        first, second = (shapes.shape(name).samples_at(np.full((1, 3), 0.3)).distance for name in shapes.names[:2])
        again = open_shape_set(source, None, 1).shape(shapes.names[0]).samples_at(np.full((1, 3), 0.3)).distance
        assert first == again != second
        assert open_shape_set(source, None, 2, first=1).names == shapes.names[1:]


def test_a_folder_of_meshes_and_the_layout_of_shapenet_are_read(tmp_path):
    flat, nested = tmp_path / "flat", tmp_path / "03001627"
    for path in (flat / "one.obj", nested / "abc" / "models" / "model_normalized.obj"):
        path.parent.mkdir(parents=True)
        trimesh.creation.icosphere(2).export(path)
    assert open_shape_set(str(flat), None, None).names == ["one"]
    shapes = open_shape_set(str(nested), "y", None)
    assert shapes.names == ["abc"]
    assert shapes.shape("abc").normalization.scale == pytest.approx(1, abs=0.01)


def test_a_folder_without_meshes_is_refused(tmp_path):
    with pytest.raises(InputError, match="contains no meshes; give a folder of files that end in"):
        open_shape_set(str(tmp_path), None, None)
    with pytest.raises(InputError, match="is not a folder; give one with meshes, or one of chairs, bowls"):
        open_shape_set(str(tmp_path / "none"), None, None)


def test_unusable_meshes_are_left_out_with_a_warning(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    with pytest.warns(UserWarning, match="a: left out"), pytest.raises(InputError, match="none of the 1 shapes"):
        sample_shapes(open_shape_set(str(tmp_path), None, None), 0, lambda done, total: None)
