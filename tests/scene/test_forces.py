"""The keys of a scene about forces and density."""

import pytest

from surfsup.errors import InputError
from surfsup.scene import Scene

FLUID = "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\n"
NAMED = "surfaces: {boat: {box: {size: [0.2, 0.2, 0.2]}}}\n"


def scene(text):
    return Scene.from_yaml(FLUID + text, "test")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("", ("container",)),
        ("container: none", ()),
        ("surface: {sphere: {radius: 0.1}}", ("container", "surface")),
        (NAMED + "container: none", ("boat",)),
    ],
)
def test_forces_are_recorded_under_the_names_of_the_solids(text, names):
    assert scene(text).solid_names == names


def test_a_scene_keeps_its_forces_and_its_density():
    original = scene(NAMED + "forces: [boat, container]\ndensity: 1025")
    assert original.forces == ["boat", "container"] and original.density == 1025
    assert Scene.from_yaml(original.to_yaml(), "copy") == original
    assert scene("").forces == [] and scene("").density == 1000 and "forces" not in scene("").to_yaml()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (NAMED + "forces: [ship]", "forces: there is no solid 'ship'; those of the scene are container, boat"),
        ("container: none\nforces: [container]", "there is no solid 'container'; those of the scene are none"),
        ("forces: true", "forces: must be 'all' or a list of names of solids"),
        ("density: 0", "density"),
        ("density: -1000", "density"),
    ],
)
def test_what_cannot_be_is_an_error_of_one_line(text, message):
    with pytest.raises(InputError, match=message) as caught:
        scene(text)
    assert "\n" not in str(caught.value)
