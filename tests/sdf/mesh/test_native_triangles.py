"""The nearest triangle by the native code is that of libigl."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.sdf import Torus
from tests.sdf.solids import fine_mesh

igl = pytest.importorskip("igl")
pytestmark = pytest.mark.skipif(
    not native.instruction_sets(), reason="the package was built without a compiler, so there is nothing native"
)
TORUS = fine_mesh(Torus, {"major_radius": 0.3, "minor_radius": 0.12})


def nearest(vertices, faces, points, max_distance=None, threads=1):
    bvh = native.TriangleBvh(np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
    distance, face, closest = np.empty(len(points)), np.empty(len(points), np.int64), np.empty((len(points), 3))
    bvh.nearest(points, max_distance, distance, face, closest, threads)
    return distance, face, closest


def by_igl(vertices, faces, points):
    tree = igl.AABB()
    tree.init(np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
    return np.sqrt(tree.squared_distance(np.asarray(vertices, np.float64), np.asarray(faces, np.int64), points)[0])


def test_distances_are_those_of_libigl_near_and_far_and_far_from_the_origin():
    random = np.random.default_rng(0)
    for offset in (0.0, 1000.0):
        vertices = np.asarray(TORUS.vertices) + offset
        points = offset + np.concatenate([random.uniform(-0.5, 0.5, (500, 3)), random.uniform(-20, 20, (50, 3))])
        distance, face, closest = nearest(vertices, TORUS.faces, points)
        np.testing.assert_allclose(distance, by_igl(vertices, TORUS.faces, points), rtol=1e-6, atol=2e-7)
        np.testing.assert_allclose(np.linalg.norm(points - closest, axis=1), distance, rtol=1e-12)
        back = trimesh.triangles.closest_point(vertices[TORUS.faces[face]], points)
        np.testing.assert_allclose(back, closest, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 60), flat=st.booleans())
@settings(max_examples=60)
def test_distances_are_those_of_libigl_for_any_triangle_soup(seed, count, flat):
    random = np.random.default_rng(seed)
    vertices = random.normal(size=(3 * count, 3)) * (1, 1, 0 if flat else 1)
    faces = random.integers(0, 3 * count, (count, 3))  # some faces use a vertex twice
    points = random.normal(size=(20, 3))
    found = nearest(vertices, faces, points)[0]
    np.testing.assert_allclose(found, by_igl(vertices, faces, points), rtol=1e-5, atol=1e-5)


def test_triangles_without_area_are_segments_and_points():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 5, 5]])
    faces = np.array([[0, 1, 2], [3, 3, 3]])
    points = np.array([[1.5, 1, 0], [-1, 0, 0], [5, 5, 6]])
    np.testing.assert_allclose(nearest(vertices, faces, points)[0], [1, 1, 1], atol=1e-6)


def test_bounds_change_nothing_even_if_they_are_tight_or_too_low():
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (300, 3))
    free = nearest(TORUS.vertices, TORUS.faces, points)
    for bound in (free[0], free[0] + 0.01, 0.5 * free[0], np.zeros(300)):
        for one, other in zip(nearest(TORUS.vertices, TORUS.faces, points, bound), free, strict=True):
            np.testing.assert_array_equal(one, other)


def test_results_do_not_depend_on_the_number_of_threads():
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (3000, 3))
    one, two = (nearest(TORUS.vertices, TORUS.faces, points, threads=threads) for threads in (1, 2))
    for first, second in zip(one, two, strict=True):
        np.testing.assert_array_equal(first, second)


def test_invalid_faces_are_refused():
    with pytest.raises(IndexError, match="a face has an invalid vertex index"):
        native.TriangleBvh(np.zeros((3, 3)), np.array([[0, 1, 3]]))
    with pytest.raises(IndexError, match="there are no triangles"):
        native.TriangleBvh(np.zeros((3, 3)), np.zeros((0, 3), np.int64))
