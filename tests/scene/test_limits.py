"""Numbers that single precision cannot hold are refused where they enter; meshes may lie anywhere on the Earth."""

import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.scene import Scene

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
