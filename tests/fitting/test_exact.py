import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.fitting.exact import ExactMesh, ExactSolid
from surfsup.sdf import Box, Sphere


def ball(radius=3.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(4, radius)


@pytest.mark.parametrize("exact", [ExactMesh(ball()), ExactSolid(Sphere(3.0))], ids=["mesh", "formula"])
def test_points_on_about_and_far_from_a_sphere_have_its_distance_and_normal(exact):
    random = np.random.default_rng(0)
    assert exact.cube.scale == pytest.approx(1 / 3)
    for known in (
        exact.on_surface(500, random), exact.around(500, (0.01, 0.1), random), exact.in_cube(500, 1.1, random),
        exact.near(500, random),
    ):  # fmt: skip
        assert len(known.points) == 500
        radius = np.linalg.norm(known.points, axis=1)
        np.testing.assert_allclose(known.distance, radius - 1, atol=4e-3)
        cosine = (known.normals * known.points).sum(axis=1) / radius
        assert cosine.min() > 0.99
    assert np.abs(known.distance).max() < 0.1


def test_points_on_a_box_are_spread_evenly():
    known = ExactSolid(Box((2.0, 1.0, 1.0))).on_surface(4000, np.random.default_rng(0))
    ends = (np.abs(known.normals[:, 0]) > 0.9).mean()
    assert ends == pytest.approx(2 / 10, abs=0.03)


def test_triangles_inside_a_solid_are_no_surface():
    """Two balls that overlap: what each hides in the other must not be learned as a surface."""
    second = ball(1.0)
    second.apply_translation([1.0, 0, 0])
    exact = ExactMesh(trimesh.util.concatenate([ball(1.0), second]))
    known = exact.on_surface(4000, np.random.default_rng(0))
    own = known.points / exact.cube.scale + np.asarray(exact.cube.center)
    outside = np.minimum(np.linalg.norm(own, axis=1), np.linalg.norm(own - [1, 0, 0], axis=1))
    assert len(known.points) < 3400
    assert outside.min() > 0.98


def test_of_a_soup_the_winding_number_decides():
    """A fifth of the triangles is missing and a third is turned over after that."""
    random = np.random.default_rng(0)
    whole = ball(1.0)
    faces = whole.faces[random.uniform(size=len(whole.faces)) > 0.2]
    exact = ExactMesh(trimesh.Trimesh(whole.vertices, faces, process=False))
    known = exact.in_cube(2000, 1.0, random)
    radius = np.linalg.norm(known.points, axis=1)
    sure = np.abs(radius - 1) > 0.1
    assert ((known.distance < 0) == (radius < 1))[sure].mean() > 0.99


def test_triangles_that_enclose_nothing_are_refused():
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.1]], [[0, 1, 2], [1, 3, 2]], process=False)
    with pytest.raises(InputError, match="divides an inside from an outside"):
        ExactMesh(sheet).on_surface(200, np.random.default_rng(0))
