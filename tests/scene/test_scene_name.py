from pathlib import Path

import pytest

from surfsup.scene import Scene
from surfsup.scene.scene_name import scene_name

BALL = "sphere: {radius: 0.1}"
FLUID = "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]"


@pytest.mark.parametrize(
    ("surface", "name"),
    [
        ("", ""),
        (f"surface: {{{BALL}}}", "sphere"),
        ("surface: {mesh: {file: some/knot.obj}}", "knot"),
        ("surface: {siren: {file: coral}}", "coral"),
        (f"surface: {{union: [{{{BALL}}}, {{{BALL}}}]}}", ""),
        (f"surfaces: {{cup: {{{BALL}}}, saucer: {{{BALL}}}}}", "cup, saucer"),
        (f"surfaces: {{{', '.join(f'{name}: {{{BALL}}}' for name in 'abcde')}}}", "a, b, c and 2 more"),
    ],
)
def test_a_scene_is_called_by_its_surfaces(surface, name):
    assert scene_name(Scene.from_yaml(f"{surface}\n{FLUID}", "test", Path())) == name
