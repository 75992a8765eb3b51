"""A fitted network as a surface."""

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.evaluation.near_surface import surface_for_metrics
from surfsup.scene import Scene
from surfsup.sdf import NeuralSurface, Sphere, Transformed, Union, fit_surface, save_deepsdf, save_siren

SCENE = """
surface: {shape}
fluid: [{{block: {{min: [-0.2, -0.2, 1.2], max: [0.2, 0.2, 1.5]}}}}]
"""


def points(count=300, reach=1.2) -> torch.Tensor:
    return reach * (2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(1)) - 1)


def scene_of(folder, shape) -> Scene:
    path = folder / "scene.yaml"
    path.write_text(SCENE.format(shape=shape))
    return Scene.load(path)


def test_it_has_the_distance_and_normal_of_its_target(ball_siren):
    places = points()
    distance, normal = ball_siren.distance_and_normal(places)
    true_distance, true_normal = Sphere(1.0).distance_and_normal(places)
    assert float((distance - true_distance).abs().mean()) < 0.02
    away = true_distance > -0.5
    assert float((normal * true_normal).sum(dim=-1)[away].mean()) > 0.99


def test_a_scaled_surface_is_f_s_of_p(ball_siren):
    places = points(reach=20.0)
    large = Transformed(ball_siren, scale=15.0)
    torch.testing.assert_close(large.distance(places), 15 * ball_siren.distance(places / 15))


def test_a_scene_places_it_and_joins_it_with_other_surfaces(ball_siren, tmp_path):
    save_siren(tmp_path / "ball.safetensors", ball_siren)
    scene = scene_of(
        tmp_path, "{union: [{siren: {file: ball.safetensors, fit: 0.6}}, {sphere: {radius: 0.1}, at: [0, 0, 0.65]}]}"
    )
    surface = scene.build_surface()
    assert isinstance(surface, Union)
    expected = Union(Transformed(Sphere(0.3), None, (0, 0, 0.3)), Transformed(Sphere(0.1), None, (0, 0, 0.65)))
    places = points(reach=0.8)
    assert float((surface.distance(places) - expected.distance(places)).abs().mean()) < 0.01
    assert len(scene.initial_particles(surface).positions) > 1000


def test_without_fit_it_keeps_the_position_of_its_mesh(ball_siren, tmp_path):
    save_siren(tmp_path / "ball.safetensors", ball_siren)
    surface = scene_of(tmp_path, "{siren: {file: ball.safetensors}}").build_surface()
    np.testing.assert_allclose(surface.bounds(), [[-0.25] * 3, [0.25] * 3], atol=0.01)


def test_metrics_use_the_exact_distance_of_its_mesh(ball_siren, tmp_path):
    save_siren(tmp_path / "ball.safetensors", ball_siren)
    surface = surface_for_metrics(scene_of(tmp_path, "{siren: {file: ball.safetensors, fit: 2.0}}"))
    (neural,) = (part for part in surface.modules() if isinstance(part, NeuralSurface))
    assert neural.exact
    far = torch.tensor([[0.0, 0.0, 1.5], [0.0, 0.0, 6.0], [0.0, 0.4, 1.0]])
    torch.testing.assert_close(surface.distance(far), torch.tensor([-0.5, 4.0, -0.6]), atol=0.03, rtol=0)
    assert surface.to_mesh().is_watertight


def test_its_mesh_is_closed_and_on_the_zero_set(ball_siren):
    mesh = ball_siren.to_mesh(48)
    assert mesh.is_watertight
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=0.03)


def test_a_shape_of_many_is_chosen_by_name_or_by_code(few_shapes, tmp_path):
    save_deepsdf(tmp_path / "few.safetensors", few_shapes)
    cube = few_shapes.code("cube").tolist()
    named = scene_of(tmp_path, "{deepsdf: {file: few.safetensors, shape: cube, fit: 0.5}}").build_surface()
    coded = scene_of(tmp_path, f"{{deepsdf: {{file: few.safetensors, code: {cube}, fit: 0.5}}}}").build_surface()
    places = points(reach=0.5)
    torch.testing.assert_close(named.distance(places), coded.distance(places))
    lower, upper = named.bounds()
    assert float(lower[2]) == pytest.approx(0, abs=1e-6)
    assert float((upper - lower).max()) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("shape", "complaint"),
    [
        ("{deepsdf: {file: few.safetensors}}", "holds 4 shapes; choose one"),
        ("{deepsdf: {file: few.safetensors, code: [1, 2]}}", "a code has 4 numbers"),
        ("{deepsdf: {file: few.safetensors, shape: cub}}", "did you mean 'cube'"),
        ("{deepsdf: {file: few.safetensors, shape: cube, code: [1, 2]}}", "give either shape or code"),
        ("{siren: {file: few.safetensors}}", "make one with 'surfsup fit siren'"),
        ("{siren: {file: none.safetensors}}", "no such file"),
    ],
)
def test_an_unusable_shape_is_named(few_shapes, tmp_path, shape, complaint):
    save_deepsdf(tmp_path / "few.safetensors", few_shapes)
    with pytest.raises(InputError, match=complaint):
        scene_of(tmp_path, shape).build_surface()


def test_a_fitted_extent_puts_the_foot_on_the_floor(ball_siren):
    lower, upper = fit_surface(ball_siren, 0.8).bounds()
    assert float(lower[2]) == pytest.approx(0, abs=1e-6)
    assert float((upper - lower).max()) == pytest.approx(0.8)
    assert torch.allclose((lower + upper)[:2], torch.zeros(2), atol=1e-6)
