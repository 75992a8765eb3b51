import pytest

from surfsup import InputError, Scene
from surfsup.scene.examples import description, example_file, example_files

SCENES = {name: path for name, path in example_files().items() if path.suffix == ".yaml"}


def test_the_examples_of_the_repository_are_found():
    assert {"knot", "teacup", "pour-from-a-cup", "stirring-paddle"} <= set(example_files())


@pytest.mark.parametrize("name", SCENES)
def test_each_is_a_scene_with_a_description(name):
    Scene.load(SCENES[name])
    text = description(SCENES[name])
    assert 20 < len(text) < 160
    assert not text.endswith(".")


def test_an_unknown_one_is_refused_with_the_nearest():
    with pytest.raises(
        InputError, match=r"no example 'tecup' \(did you mean 'teacup'\?\); there are boat, dragon, honey, knot"
    ):
        example_file("tecup")
