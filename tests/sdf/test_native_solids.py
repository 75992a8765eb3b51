"""Distances by the native code are those of torch, which other tests compare with independent geometry."""

from pathlib import Path

import numpy as np
import pytest
import torch

from surfsup import native
from surfsup.sdf import (
    Bowl,
    Box,
    Boxes,
    CappedCone,
    Cylinder,
    Difference,
    Funnel,
    Intersection,
    MeshSurface,
    Sphere,
    Surface,
    Torus,
    Transformed,
    Union,
    axis_rotation,
    fit_surface,
    load_deepsdf,
    load_siren,
)
from surfsup.sdf.native_query import distance_and_normal_native, distance_native
from surfsup.sdf.neural.deepsdf import DeepSdfSurface
from surfsup.sdf.neural.deepsdf_decoder import DecoderSizes, DeepSdfDecoder
from surfsup.sdf.neural.sine_network import SineNetwork
from surfsup.sdf.neural.siren import SirenSurface
from tests.sdf.solids import SHAPES, points_around

pytestmark = pytest.mark.skipif(
    not native.instruction_sets(), reason="the package was built without a compiler, so there is no native code"
)

ROTATION = axis_rotation((1.0, 2.0, -0.5), 40.0)


def boxes(count: int = 7) -> Boxes:
    random = torch.Generator().manual_seed(0)
    rotations = torch.stack([axis_rotation(torch.randn(3, generator=random), 30.0 * k) for k in range(count)])
    return Boxes(
        0.05 + 0.3 * torch.rand(count, 3, generator=random),
        rotations.float(),
        torch.rand(count, 3, generator=random) - 0.5,
    )


def sines(width: int, layers: int) -> SirenSurface:
    torch.manual_seed(width)
    return SirenSurface(SineNetwork(width, layers, 5.0), torch.tensor([[-1.0] * 3, [1.0] * 3])).requires_grad_(False)


def code(width: int, layers: int, octaves: int) -> DeepSdfSurface:
    torch.manual_seed(width)
    network = DeepSdfDecoder(DecoderSizes(width, layers, 5, octaves))
    return DeepSdfSurface(network, torch.randn(5)).requires_grad_(False)


CORAL = fit_surface(load_siren(Path("coral")), 0.6)
CHAIR = load_deepsdf(Path("chairs"))
CHAIR = Transformed(CHAIR.surface(CHAIR.code("chair-0100")).with_grid(), ROTATION, (0.1, 0.0, 0.2), 0.4)


def mesh_with_hole() -> MeshSurface:
    """A mesh of a ball with a hole."""
    mesh = Sphere(0.3).to_mesh(24)
    mesh.update_faces(np.arange(len(mesh.faces)) > 20)
    return MeshSurface(mesh, cells=24)


TORUS = MeshSurface(Torus(0.3, 0.1).to_mesh(48), cells=32)
SOLIDS = {
    **{name: kind(**parameters) for name, (kind, parameters) in SHAPES.items()},
    "bowl": Bowl(0.3, 0.08),
    "closed bowl": Bowl(0.3),
    "funnel": Funnel(0.3, 0.06, 0.25, 0.1),
    "boxes": boxes(),
    "transformed": Transformed(CappedCone(0.5, 0.3, 0.1), ROTATION, (0.2, -0.1, 0.3), 1.7),
    "mirrored": Transformed(Box((0.3, 0.4, 0.5)), torch.diag(torch.tensor([-1.0, 1.0, 1.0])), (0.1, 0.0, 0.0)),
    "twice transformed": Transformed(Transformed(Torus(0.3, 0.1), ROTATION, (0.1, 0, 0)), ROTATION, (0, 0.2, 0), 0.5),
    "union": Union(Transformed(Sphere(0.3), None, (0.25, 0, 0)), Box((0.4, 0.4, 0.4)), Funnel(0.3, 0.1)),
    "intersection": Intersection(Sphere(0.3), Transformed(Box((0.5, 0.5, 0.5)), ROTATION, (0.1, 0, 0))),
    "difference": Difference(Cylinder(0.3, 0.6), Transformed(Sphere(0.2), None, (0.0, 0.0, 0.25))),
    "sines": CORAL.surface,
    "sines without a grid, with channels that fill no vector": sines(37, 2),
    "one layer of sines": sines(8, 1),
    "sines far away": Transformed(sines(6, 1), ROTATION, (3.0, -2.0, 1.0), 2.0),
    "a code": CHAIR,
    "a code without octaves": code(18, 2, 0),
    "a code with many octaves": Transformed(code(8, 2, 8), None, (0.0, 0.0, 0.0), 0.1),
    "a code without a grid": Transformed(code(16, 5, 3), ROTATION, (0.2, -0.1, 0.3), 0.5),
    "mesh": TORUS,
    "mesh with a hole": mesh_with_hole(),
    "mesh seen from afar": Transformed(MeshSurface(Box((0.1, 0.2, 0.3)).to_mesh(16)), ROTATION, (2.0, -1.0, 3.0), 0.2),
    "meshes and a ball": Union(
        Difference(Transformed(TORUS, ROTATION, (0.1, 0.2, 0.3), 1.2), Sphere(0.3)), Transformed(TORUS)
    ),
    "nested": Union(Difference(Union(Sphere(0.3), Box((0.7, 0.2, 0.2))), Cylinder(0.1, 1.0)), boxes(3)),
}
every_solid = pytest.mark.parametrize("name", SOLIDS)
every_isa = pytest.mark.parametrize("isa", native.instruction_sets())


def by_torch(surface: Surface, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """In double precision, for which there is no native code."""
    distance, normal = surface.distance_and_normal(points.double())
    return distance.float(), normal.float()


@every_isa
@every_solid
def test_distance_and_normal_are_those_of_torch(name, isa, monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", lambda: [isa])
    surface = SOLIDS[name]
    assert surface.native_solid() is not None
    points = points_around(surface, 5000, dtype=torch.float32)
    distance, normal = surface.distance_and_normal(points)
    expected, expected_normal = by_torch(surface, points)
    torch.testing.assert_close(distance, expected, atol=1e-6, rtol=0)
    # Rounding may select the other side of a medial axis.
    same = (normal - expected_normal).abs().amax(dim=-1) < 1e-3
    assert same.float().mean() > 0.998
    assert torch.linalg.vector_norm(normal, dim=-1).sub(1).abs().max() < 1e-5


def test_the_normal_of_a_union_of_networks_and_meshes_is_that_of_the_nearest():
    parts = [Transformed(CORAL, ROTATION, (0.1, 0.2, 0.3), 1.2), Difference(Box((0.5, 0.6, 0.7)), CHAIR), CHAIR, TORUS]
    union = Transformed(Union(*parts), ROTATION, (0.1, 0.0, 0.0), 0.5)
    points = points_around(union, 5000, dtype=torch.float32)
    distance, normal = union.distance_and_normal(points)
    torch.testing.assert_close(distance, by_torch(union, points)[0], atol=1e-6, rtol=0)
    own = union.to_own_frame(points)
    results = [part.distance_and_normal(own) for part in parts]
    distances, normals = (torch.stack(values) for values in zip(*results, strict=True))
    nearest, second = distances.sort(dim=0).values[:2]
    expected = normals[distances.argmin(dim=0), torch.arange(5000)] @ ROTATION.T
    clear = second - nearest > 1e-5
    assert clear.float().mean() > 0.9
    torch.testing.assert_close(normal[clear], expected[clear], atol=1e-3, rtol=0)


@every_solid
def test_the_distance_alone_is_the_same(name):
    surface = SOLIDS[name]
    points = points_around(surface, 1300, dtype=torch.float32)
    assert torch.equal(distance_native(surface, points), distance_and_normal_native(surface, points)[0])


@every_solid
def test_no_points_odd_counts_and_points_that_are_not_finite(name):
    surface = SOLIDS[name]
    for count in (0, 1, 15, 17):
        points = points_around(surface, count, dtype=torch.float32)
        distance, normal = surface.distance_and_normal(points)
        assert distance.shape == (count,) and normal.shape == (count, 3)
        torch.testing.assert_close(distance, surface.distance(points), atol=1e-6, rtol=0)
    for axis in range(3):
        points = torch.full((2, 3), 0.123)
        points[0, axis] = torch.nan
        distance, normal = surface.distance_and_normal(points)
        assert distance.isnan().tolist() == [True, False]
        assert normal.isnan().any(dim=-1).tolist() == [True, False]


def test_the_normal_is_zero_where_there_is_no_direction():
    distance, normal = Sphere(0.3).distance_and_normal(torch.zeros(1, 3))
    assert float(distance) == pytest.approx(-0.3)
    assert not normal.any()


def test_changed_parameters_of_a_shape_take_effect():
    surface = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.0))
    point = torch.tensor([[1.0, 0.0, 0.0]])
    surface.surface.radius.fill_(0.4)
    surface.translation[0] = 0.1
    assert float(surface.distance_and_normal(point)[0]) == pytest.approx(0.5, abs=1e-6)


def test_changed_weights_of_a_network_take_effect():
    for surface in (sines(16, 2), code(16, 3, 1)):
        points = points_around(surface, 100, dtype=torch.float32)
        before = surface.distance_and_normal(points)[0]
        with torch.no_grad():
            for value in (*surface.network.parameters(), *surface.buffers()):
                value.mul_(1.1)
        torch.testing.assert_close(
            surface.distance_and_normal(points)[0], by_torch(surface, points)[0], atol=1e-5, rtol=0
        )
        assert not torch.allclose(surface.distance_and_normal(points)[0], before, atol=1e-3)


def test_on_faces_and_vertices_distance_and_normal_are_those_of_the_mesh():
    vertices = torch.tensor(TORUS.query.vertices, dtype=torch.float32)
    middles = vertices[torch.tensor(TORUS.query.faces)].mean(dim=1)
    for points in (vertices, middles):
        distance, normal = TORUS.distance_and_normal(points)
        expected, expected_normal = by_torch(TORUS, points)
        torch.testing.assert_close(distance, expected, atol=1e-7, rtol=0)
        torch.testing.assert_close(normal, expected_normal, atol=1e-5, rtol=0)


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_of_a_mesh_query_in_python_is_raised(threads, monkeypatch):
    def broken(*_: object) -> None:
        raise RuntimeError("the mesh is broken")

    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    mesh = MeshSurface(Sphere(0.3).to_mesh(16), cells=16)
    monkeypatch.setattr(mesh, "query_near_node", broken)
    points = torch.tensor(mesh.query.vertices[:1], dtype=torch.float32).repeat(3000, 1)
    try:
        with pytest.raises(RuntimeError, match="the mesh is broken"):
            Union(mesh, Sphere(0.1)).distance_and_normal(points)
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("wrong", ["fine", "coarse", "node_distance"])
def test_grids_that_do_not_match_are_refused(wrong):
    fine, coarse = TORUS.build_grids()
    given = {
        "bvh": TORUS.query.bvh,
        "fine": fine.native_arguments(),
        "coarse": coarse.native_arguments(),
        "node_distance": fine.node_distance.flatten().numpy(),
        "mesh_range": 0.1,
        "min_agreement": 0.9,
        "on_surface": 1e-6,
        "query_undecided": TORUS.write_undecided,
    }
    native.Solid.of_mesh(**given)
    value = given[wrong]
    given[wrong] = (value[0][:-1], *value[1:]) if isinstance(value, tuple) else value[:-1]
    with pytest.raises(ValueError):
        native.Solid.of_mesh(**given)


def test_torch_computes_networks_with_too_many_octaves():
    surface = code(8, 2, 17)
    assert surface.native_solid() is None
    assert torch.isfinite(surface.distance(torch.rand(5, 3))).all()


def test_a_code_may_be_a_strided_view():
    surface = code(16, 3, 1)
    points = points_around(surface, 50, dtype=torch.float32)
    strided = DeepSdfSurface(surface.network, torch.stack([surface.code] * 2, dim=1)[:, 1])
    assert torch.equal(strided.distance(points), surface.distance(points))


def test_a_native_solid_keeps_the_weights_it_was_made_with():
    surface = sines(16, 2)
    solid, points = surface.native_solid(), points_around(surface, 100, dtype=torch.float32).numpy()
    before, after = (np.empty(100, np.float32) for _ in range(2))
    solid.evaluate(points, before, None, native.instruction_sets()[0], 1)
    with torch.no_grad():
        for value in surface.network.parameters():
            value.mul_(1.1)
    solid.evaluate(points, after, None, native.instruction_sets()[0], 1)
    assert np.array_equal(before, after)


def test_a_network_far_from_its_cube_gives_finite_distances():
    surface = sines(16, 2)
    assert torch.isfinite(surface.distance(torch.full((3, 3), 1e9))).all()


@pytest.mark.parametrize("error", [0.0, 2e-4])
def test_meshes_and_closed_forms_have_the_same_position_even_with_rounded_rotations(error):
    rotation = ROTATION + error * torch.randn(3, 3, generator=torch.Generator().manual_seed(0))
    mesh, ball = (
        Transformed(Transformed(part, ROTATION, (1.0, 1.0, 0.0)), rotation, (0.3, 0.2, 0.1))
        for part in (TORUS, Torus(0.3, 0.1))
    )
    points = points_around(ball, 500, dtype=torch.float32)
    torch.testing.assert_close(mesh.distance_and_normal(points)[0], by_torch(mesh, points)[0], atol=2e-6, rtol=0)


def test_exact_queries_of_a_network_are_not_native():
    surface = load_siren(Path("coral"))
    surface.exact = True
    assert surface.native_solid() is None
    assert Transformed(surface).native_solid() is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"layers": []},
        {"octaves": 1},
        {"octaves": -1},
        {"last": np.ones(4, np.float32)},
        {"last_bias": np.ones(2, np.float32)},
        {"layers": [(np.ones((5, 5), np.float32), np.ones((5, 3), np.float32), [], None)]},
        {"layers": [(None, np.ones((5, 3), np.float32), [], None)] * 2},
        {"layers": [(None, np.ones((5, 3), np.float32), [np.ones(4, np.float32)], None)]},
        {"layers": [(None, np.ones((5, 3), np.float32), [], np.ones((5, 2), np.float32))]},
        {"grid": (np.ones((8, 4), np.float32), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1, (2, 2, 3))},
        {"grid": (np.ones((8, 4), np.float32), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1, (8, 1, 1))},
    ],
)
def test_layers_that_do_not_match_are_refused(wrong):
    right = {
        "layers": [(None, np.ones((5, 3), np.float32), [], None)],
        "last": np.ones(5, np.float32),
        "last_bias": np.ones(1, np.float32),
        "code": None,
        "frequency": 1.0,
        "octaves": 0,
        "grid": None,
        "network_range": 0.1,
    }
    native.Solid.of_network(**right)
    with pytest.raises(ValueError):
        native.Solid.of_network(**(right | wrong))


def test_torch_computes_gradients_double_precision_and_unsupported_solids():
    points = torch.rand(4, 3)
    assert distance_and_normal_native(Sphere(0.3), points) is not None
    assert distance_and_normal_native(Sphere(0.3), points.double()) is None
    assert distance_and_normal_native(Sphere(0.3), points.clone().requires_grad_()) is None
    shape = torch.tensor(0.3, requires_grad=True)
    assert distance_and_normal_native(Sphere(shape), points) is None
    with torch.no_grad():
        assert distance_and_normal_native(Sphere(shape), points) is not None
    mesh = MeshSurface(Box((0.4, 0.4, 0.4)).to_mesh(8), exact=True)
    assert Union(Sphere(0.2), mesh).native_solid() is None
    assert Transformed(mesh).native_solid() is None


@pytest.mark.parametrize(
    ("kind", "parameters", "parts"),
    [("sphere", [], []), ("ball", [1.0], []), ("union", [], []), ("boxes", [1.0] * 16, []), ("box", [1.0] * 3, ["it"])],
)
def test_native_solids_with_wrong_parameters_or_parts_are_refused(kind, parameters, parts):
    with pytest.raises(ValueError, match="native"):
        native.Solid(kind, parameters, [native.Solid("sphere", [1.0], []) for _ in parts])


def test_arrays_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="distance has 3 rows, but must have 2"):
        native.Solid("sphere", [1.0], []).evaluate(
            np.zeros((2, 3), np.float32),
            np.zeros(3, np.float32),
            np.zeros((2, 3), np.float32),
            native.instruction_sets()[0],
            1,
        )
