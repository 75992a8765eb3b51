"""Numbers that single precision cannot hold are refused where they enter; meshes may lie anywhere on the Earth."""

import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.solids import build_solids

FLUID = "fluid: [{{block: {{min: [-0.1, -0.1, 1.0], max: [0.1, 0.1, 1.2], velocity: [{velocity}, 0, 0]}}}}]\n"


@pytest.mark.parametrize("value", ["1.0e+20", "1.0e+39", "1.0e+300", "-1.0e+30"])
@pytest.mark.parametrize(
    ("text", "place"),
    [
        (FLUID.replace("{velocity}", "VALUE"), "fluid.0.block.velocity.0"),
        ("gravity: [0, 0, VALUE]\n" + FLUID, "gravity.2"),
        ("container: {{size: [VALUE, 1, 2]}}\n" + FLUID, "container.size.0"),
        ("surface: {{sphere: {{radius: VALUE}}}}\n" + FLUID, "surface.sphere.radius"),
        ("surface: {{sphere: {{radius: 1}}, at: [VALUE, 0, 0]}}\n" + FLUID, "surface.at.0"),
        (
            "surface: {{box: {{size: [1, 1, 1]}}, rotate: {{axis: [1, 0, 0], degrees: VALUE}}}}\n" + FLUID,
            "rotate.degrees",
        ),
    ],
)
def test_a_number_out_of_range_is_refused_at_its_key(text, place, value):
    with pytest.raises(InputError, match=place):
        Scene.from_yaml(text.format(velocity=0).replace("VALUE", value), "scene.yaml")


def test_a_mesh_in_coordinates_of_the_earth_loses_nothing_when_it_is_moved_into_the_container(tmp_path):
    middle, radius = np.array([456789.25, 5345678.5, 512.75]), 0.3
    ball = trimesh.creation.icosphere(3, radius)
    ball.apply_translation(middle)
    (tmp_path / "utm.obj").write_text(ball.export(file_type="obj", digits=9))
    points = torch.tensor([[0.0, 0.0, 1.3], [0.6, 0.8, 0.5], [0.1, 0.0, 0.5]])
    expected = torch.linalg.vector_norm(points - torch.tensor([0.0, 0.0, 0.5]), dim=-1)
    for degrees, scale in ((0, 1.0), (30, 1.5)):
        angle = np.deg2rad(degrees)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        at = (np.array([0, 0, 0.5]) - scale * turn @ middle).tolist()
        placed = f"rotate: {{axis: [0, 0, 1], degrees: {degrees}}}, scale: {scale}, at: {at}"
        text = f"surface: {{mesh: {{file: utm.obj}}, {placed}}}\n" + FLUID.format(velocity=0)
        surface = Scene.from_yaml(text, "scene.yaml", tmp_path).build_surface()
        torch.testing.assert_close(surface.distance(points), expected - scale * radius, atol=4e-3, rtol=0)


def test_combined_meshes_in_coordinates_of_the_earth_come_back_one_by_one(tmp_path):
    middle = np.array([345678.25, 5345612.5, 512.75])
    ball = trimesh.creation.icosphere(3, 0.3)
    ball.apply_translation(middle)
    (tmp_path / "utm.obj").write_text(ball.export(file_type="obj", digits=9))
    part = "{mesh: {file: utm.obj}, at: %s}"
    parts = f"[{part % '[0, 0, 0]'}, {{union: [{part % '[0.4, 0, 0]'}]}}]"
    turned = (np.array([0, 0, 0.5]) - 1.5 * middle @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]).tolist()
    points = torch.tensor([[0.0, 0.0, 1.3], [0.6, 0.8, 0.5], [0.1, 0.9, 0.5]])
    for rest, second in (
        (f"at: {(np.array([0, 0, 0.5]) - middle).tolist()}", [0.4, 0, 0.5]),
        (f"rotate: {{axis: [0, 0, 2], degrees: 90}}, scale: 1.5, at: {turned}", [0.0, 0.6, 0.5]),
    ):
        text = f"surface: {{union: {parts}, {rest}}}\n" + FLUID.format(velocity=0)
        surface = Scene.from_yaml(text, "scene.yaml", tmp_path).build_surface()
        radius = 0.3 if "scale" not in rest else 0.45
        centers = torch.tensor([[0.0, 0.0, 0.5], second])
        expected = torch.cdist(points, centers).amin(dim=1) - radius
        torch.testing.assert_close(surface.distance(points), expected, atol=6e-3, rtol=0)


def test_a_mesh_far_from_its_own_origin_may_not_move(tmp_path):
    ball = trimesh.creation.icosphere(1, 0.3)
    ball.apply_translation([345678.25, 0, 0])
    (tmp_path / "utm.obj").write_text(ball.export(file_type="obj", digits=9))
    text = "surfaces: {ball: {mesh: {file: utm.obj}, motion: {spin: {axis: [0, 0, 1], turns: 1}}}}\n"
    scene = Scene.from_yaml(text + FLUID.format(velocity=0), "scene.yaml", tmp_path)
    with pytest.raises(InputError, match="give a mesh 'fit'"):
        build_solids(scene)
