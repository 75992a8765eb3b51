import math

import numpy as np
import pytest
import torch

from surfsup import sdf
from surfsup.scene import Scene, Shape

WATER = "fluid: [{block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.4]}}]\n"


def built(surface: str) -> sdf.Surface:
    return Scene.from_yaml(WATER + f"surface: {surface}", "scene.yaml").build_surface()


def assert_same_distance(one: sdf.Surface, other: sdf.Surface) -> None:
    points = torch.rand(500, 3, generator=torch.Generator().manual_seed(1)) * 2 - 1
    torch.testing.assert_close(one.distance(points), other.distance(points))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{sphere: {radius: 0.3}}", sdf.Sphere(0.3)),
        ("{box: {size: [0.2, 0.3, 0.4]}}", sdf.Box((0.2, 0.3, 0.4))),
        ("{cylinder: {radius: 0.2, height: 0.5}}", sdf.Cylinder(0.2, 0.5)),
        ("{cone: {height: 0.5, bottom_radius: 0.3}}", sdf.CappedCone(0.5, 0.3, 0.01)),
        ("{cone: {height: 0.5, bottom_radius: 0.3, top_radius: 0.1}}", sdf.CappedCone(0.5, 0.3, 0.1)),
        ("{torus: {major_radius: 0.3, minor_radius: 0.1}}", sdf.Torus(0.3, 0.1)),
        ("{bowl: {capture_radius: 0.3}}", sdf.Bowl(0.3, 0.0, 0.04)),
        ("{bowl: {capture_radius: 0.3, filter_radius: 0.1, wall: 0.05}}", sdf.Bowl(0.3, 0.1, 0.05)),
        ("{funnel: {capture_radius: 0.3, filter_radius: 0.1}}", sdf.Funnel(0.3, 0.1, 0.25, 0.1, 0.04)),
    ],
)
def test_every_kind_builds_its_surface(text, expected):
    shape = built(text)
    assert type(shape) is type(expected)
    assert_same_distance(shape, expected)


def test_a_heightfield_path_is_relative_to_the_scene_file(tmp_path):
    heights = np.array([[0.0, 1.0], [2.0, 4.0]])
    np.save(tmp_path / "hill.npy", heights)
    text = WATER + "surface: {heightfield: {file: hill.npy, size: [2, 1], height: 0.5}, at: [0, 0, 0.2]}"
    found = Scene.from_yaml(text, "scene.yaml", tmp_path).build_surface()
    assert_same_distance(found, sdf.Transformed(sdf.Heightfield(heights, (2, 1), 0.5, 0.1), translation=(0, 0, 0.2)))


def test_a_shape_is_scaled_then_rotated_then_moved():
    shape = built("{box: {size: [0.2, 0.4, 0.6]}, scale: 2, rotate: {axis: [0, 0, 3], degrees: 90}, at: [0, 0, 1]}")
    # Scaled by 2, its longer side y rotated into x, then raised.
    on_surface = torch.tensor([[0.4, 0.0, 1.0], [0.0, 0.2, 1.0], [0.0, 0.0, 1.6]])
    torch.testing.assert_close(shape.distance(on_surface), torch.zeros(3), atol=1e-6, rtol=0)


def test_nested_combinations_equal_those_built_by_hand():
    text = """
      difference:
        - union:
            - sphere: {radius: 0.3}
              at: [0.2, 0, 0]
            - intersection: [{box: {size: [0.5, 0.5, 0.5]}}, {cylinder: {radius: 0.2, height: 2}}]
              rotate: {axis: [1, 1, 0], degrees: 40}
          scale: 1.5
        - torus: {major_radius: 0.3, minor_radius: 0.1}
          rotate: {axis: [0, 1, 0], degrees: -30}
          at: [0, 0.1, 0.2]
      at: [0, 0, 0.1]
    """
    rotation = sdf.axis_rotation((1, 1, 0), 40)
    expected = sdf.Transformed(
        sdf.Difference(
            sdf.Transformed(
                sdf.Union(
                    sdf.Transformed(sdf.Sphere(0.3), None, (0.2, 0, 0)),
                    sdf.Transformed(sdf.Intersection(sdf.Box((0.5, 0.5, 0.5)), sdf.Cylinder(0.2, 2.0)), rotation),
                ),
                scale=1.5,
            ),
            sdf.Transformed(sdf.Torus(0.3, 0.1), sdf.axis_rotation((0, 1, 0), -30), (0, 0.1, 0.2)),
        ),
        None,
        (0, 0, 0.1),
    )
    assert_same_distance(built(text), expected)


def test_the_kind_is_the_key_with_a_value():
    assert Shape.model_validate({"sphere": {"radius": 1}}).kind == "sphere"
    assert Shape.model_validate({"union": [{"sphere": {"radius": 1}}]}).kind == "union"


def test_full_rotations_change_nothing():
    angle = 360 * 3 + 90
    once, often = (
        built(f"{{box: {{size: [1, 2, 3]}}, rotate: {{axis: [0, 1, 0], degrees: {a}}}}}") for a in (90, angle)
    )
    assert math.isclose(float(once.distance(torch.ones(1, 3))), float(often.distance(torch.ones(1, 3))), abs_tol=1e-5)
    assert_same_distance(once, often)


def test_the_boxes_of_a_union_are_batched():
    box = "{box: {size: [0.2, 0.3, 0.4]}, rotate: {axis: [0, 1, 0], degrees: 20}, at: [0.3, 0, 0]}"
    larger, ball = "{box: {size: [0.2, 0.3, 0.4]}, scale: 2}", "{sphere: {radius: 0.3}}"
    expected = [
        sdf.Transformed(sdf.Box((0.2, 0.3, 0.4)), sdf.axis_rotation((0, 1, 0), 20), (0.3, 0, 0)),
        sdf.Box((0.1, 0.9, 0.1)),
        sdf.Transformed(sdf.Box((0.2, 0.3, 0.4)), scale=2.0),
        sdf.Sphere(0.3),
    ]
    assert isinstance(built(f"{{union: [{box}, {box}]}}"), sdf.Boxes)
    together = built(f"{{union: [{box}, {ball}, {{box: {{size: [0.1, 0.9, 0.1]}}}}, {larger}]}}")
    assert isinstance(together.parts[0], sdf.Boxes)
    assert_same_distance(together, sdf.Union(*expected))
