"""What is wrong with a scene is said with the name of its file, whenever it is found."""

from pathlib import Path

import pytest

from surfsup.cli.scene_options import SceneOptions
from surfsup.errors import InputError
from tests.cli.test_cli import surfsup

WATER = "container: {size: [0.4, 0.4, 0.4]}\nfluid: [{block: {min: [-0.1, -0.1, 0.2], max: [0.1, 0.1, 0.35]}}]\n"
FAR = WATER + "surfaces: {boat: {box: {size: [0.1, 0.1, 0.1]}, at: [0, 0, 3], rigid_body: {}}}\n"
EMPTY = WATER + "surface: {difference: [{sphere: {radius: 0.1}}, {sphere: {radius: 0.2}}]}\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [(FAR, "surface 'boat' is a rigid body that begins"), (EMPTY, "the surface has no inside")],
)
def test_it_is_named_at_the_set_up_and_in_the_first_frame(tmp_path, text, complaint):
    (tmp_path / "scene.yaml").write_text(text)
    done = surfsup("simulate", "scene.yaml", "-o", "out", "--no-video", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"surfsup: scene.yaml: {complaint}")


@pytest.mark.parametrize(
    ("source", "text", "named"),
    [
        ("a.yaml", "fluid: is empty", "a.yaml: fluid: is empty"),
        ("a.yaml", "a.yaml: fluid: is empty", "a.yaml: fluid: is empty"),
        ("ball.stl", "the mesh is flat", "the mesh is flat"),
    ],
)
def test_it_is_named_once_and_only_if_there_is_a_scene_file(source, text, named):
    with pytest.raises(InputError) as raised, SceneOptions(Path(source)).named():
        raise InputError(text)
    assert str(raised.value) == named
