import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.fitting.exact_shape import ExactMesh, ExactSurface
from surfsup.sdf import Box, Sphere


def ball(radius=3.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(4, radius)


@pytest.mark.parametrize("exact", [ExactMesh(ball()), ExactSurface(Sphere(3.0))], ids=["mesh", "formula"])
def test_all_samples_of_a_sphere_have_its_distance_and_normal(exact):
    random = np.random.default_rng(0)
    assert exact.normalization.scale == pytest.approx(1 / 3)
    for samples in (
        exact.sample_surface(500, random), exact.sample_around(500, (0.01, 0.1), random),
        exact.sample_cube(500, 1.1, random), exact.sample_near(500, random),
    ):  # fmt: skip
        assert len(samples.points) == 500
        radius = np.linalg.norm(samples.points, axis=1)
        np.testing.assert_allclose(samples.distance, radius - 1, atol=4e-3)
        cosine = (samples.normals * samples.points).sum(axis=1) / radius
        assert cosine.min() > 0.99
    assert np.abs(samples.distance).max() < 0.1


def test_surface_samples_of_a_box_are_uniform():
    samples = ExactSurface(Box((2.0, 1.0, 1.0))).sample_surface(4000, np.random.default_rng(0))
    ends = (np.abs(samples.normals[:, 0]) > 0.9).mean()
    assert ends == pytest.approx(2 / 10, abs=0.03)


def test_triangles_inside_a_solid_are_not_surface():
    """The part of each of two overlapping balls inside the other must not be learned as a surface."""
    second = ball(1.0)
    second.apply_translation([1.0, 0, 0])
    exact = ExactMesh(trimesh.util.concatenate([ball(1.0), second]))
    samples = exact.sample_surface(4000, np.random.default_rng(0))
    original = samples.points / exact.normalization.scale + np.asarray(exact.normalization.center)
    outside = np.minimum(np.linalg.norm(original, axis=1), np.linalg.norm(original - [1, 0, 0], axis=1))
    assert len(samples.points) < 3400
    assert outside.min() > 0.98


def test_the_winding_number_decides_the_inside_of_a_broken_mesh():
    """A fifth of the triangles is missing."""
    random = np.random.default_rng(0)
    whole = ball(1.0)
    faces = whole.faces[random.uniform(size=len(whole.faces)) > 0.2]
    exact = ExactMesh(trimesh.Trimesh(whole.vertices, faces, process=False))
    samples = exact.sample_cube(2000, 1.0, random)
    radius = np.linalg.norm(samples.points, axis=1)
    far = np.abs(radius - 1) > 0.1
    assert ((samples.distance < 0) == (radius < 1))[far].mean() > 0.99


def test_a_mesh_without_an_inside_is_refused():
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.1]], [[0, 1, 2], [1, 3, 2]], process=False)
    with pytest.raises(InputError, match="separates an inside from an outside"):
        ExactMesh(sheet).sample_surface(200, np.random.default_rng(0))
