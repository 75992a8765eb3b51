import numpy as np
import pytest
import torch
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.evaluation.near_surface import ContactTracker, surface_for_metrics
from surfsup.scene import Scene
from surfsup.sdf import Box, Difference, MeshSurface, Sphere, Surface, Transformed, Union

BALL = Sphere(0.3)
SOLIDS = [
    BALL,
    Box((0.4, 0.5, 0.6)),
    Union(Sphere(0.2), Transformed(Box((0.2, 0.2, 0.2)), None, (0.2, 0, 0))),
    Difference(Sphere(0.4), Sphere(0.3)),
]


@pytest.fixture(scope="module", params=[*SOLIDS, "mesh"], ids=lambda solid: type(solid).__name__)
def solid(request):
    """Each solid; the mesh is built here, because libigl complains about objects that outlive the tests."""
    return MeshSurface(trimesh.creation.icosphere(2, 0.3), exact=True) if request.param == "mesh" else request.param


class Counting(Surface):
    """A ball that counts queries."""

    def __init__(self) -> None:
        super().__init__()
        self.queries = 0

    def distance(self, points):
        self.queries += len(points)
        return BALL.distance(points)

    def bounds(self):
        return BALL.bounds()


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), speed=st.floats(0.001, 0.2))
def test_results_equal_a_query_for_every_particle_in_every_frame(solid, seed, speed):
    random = np.random.default_rng(seed)
    positions = random.uniform(-0.6, 0.6, (40, 3)).astype(np.float32)
    tracker = ContactTracker(solid, 0.09)
    for _ in range(30):
        distance = solid.distance(torch.from_numpy(positions)).numpy()
        found = tracker.classify(positions)
        undecided = np.abs(distance - 0.09) < 1e-6
        np.testing.assert_array_equal(found.near[~undecided], (distance < 0.09)[~undecided])
        np.testing.assert_allclose(np.sort(found.depths), np.sort(distance[distance < 0]), atol=1e-6)
        positions += random.normal(scale=speed, size=positions.shape).astype(np.float32)


def test_depths_are_the_distances_of_the_particles_inside():
    tracker = ContactTracker(BALL, 0.09)
    found = tracker.classify(np.float32([[0, 0, 0.25], [0, 0.35, 0], [0.5, 0, 0], [0, 0, 0]]))
    assert found.near.tolist() == [True, True, False, True]
    assert found.depths == pytest.approx([-0.05, -0.3], abs=1e-6)


def test_particles_at_rest_or_far_away_need_no_further_query():
    solid = Counting()
    tracker = ContactTracker(solid, 0.09)
    positions = np.float32([[0, 0, 0.35], [0, 0, 0.8]])  # 0.05 and 0.5 from the surface
    for _ in range(10):
        tracker.classify(positions)
        positions = positions - np.float32([[0, 0, 0.0001], [0, 0, 0.01]])
    assert solid.queries == 2


def test_a_particle_that_is_not_finite_is_neither_near_nor_inside():
    tracker = ContactTracker(BALL, 0.09)
    found = tracker.classify(np.float32([[np.nan, 0, 0], [0, 0, 0.35]]))
    assert (found.near.tolist(), len(found.depths)) == ([False, True], 0)
    assert tracker.classify(np.float32([[0, 0, 0.1], [np.inf, 0, 0]])).near.tolist() == [True, False]


def test_without_a_solid_no_particle_is_near():
    found = ContactTracker(None, 0.09).classify(np.zeros((4, 3), dtype=np.float32))
    assert (found.near.any(), len(found.depths)) == (False, 0)


def test_all_meshes_of_a_scene_use_exact_distances(tmp_path):
    trimesh.creation.icosphere(3, 0.3).export(tmp_path / "ball.stl")
    text = (
        "surface: {union: [{sphere: {radius: 0.1}}, {mesh: {file: ball.stl}, at: [0, 0, 0.3]}]}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]"
    )
    scene = Scene.from_yaml(text, "test", tmp_path)
    meshes = [part for part in surface_for_metrics(scene).modules() if isinstance(part, MeshSurface)]
    assert [mesh.exact for mesh in meshes] == [True]
    assert surface_for_metrics(scene.model_copy(update={"surface": None})) is None
