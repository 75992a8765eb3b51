import pytest

from surfsup.errors import InputError
from surfsup.sweep.variation import Variation, replaced

SCENE = {"gravity": [0, 0, -9.81], "surface": {"sphere": {"radius": 0.2}}, "fluid": [{"block": {"min": [0, 0, 0]}}]}


@pytest.mark.parametrize(
    ("text", "key", "values"),
    [
        ("gravity.2=-9.81:-1.62:3", "gravity.2", (-9.81, -5.715, -1.62)),
        ("frames=100,200", "frames", (100, 200)),
        ("particle_radius = 0.01, 0.015", "particle_radius", (0.01, 0.015)),
        ("surface.mesh.up=y,z", "surface.mesh.up", ("y", "z")),
        ("a=1:1:1", "a", (1.0,)),
        ("a=1e-3", "a", (0.001,)),
    ],
)
def test_a_key_and_its_values(text, key, values):
    assert Variation.parse(text) == Variation(key, values)


@pytest.mark.parametrize(
    "text", ["", "gravity", "=1", "a=", "a=1,,2", "a=1:2", "a=1:2:x", "a=1:2:0", "a=1:nan:3", "a=1:2:3:4", "a=1:2:1e9"]
)
def test_another_form_is_refused_in_one_line(text):
    with pytest.raises(InputError) as error:
        Variation.parse(text)
    assert "\n" not in str(error.value)
    assert text in str(error.value)


def test_a_value_is_replaced_in_a_copy():
    assert replaced(SCENE, "gravity.2", -1, "a")["gravity"] == [0, 0, -1]
    assert replaced(SCENE, "surface.sphere.radius", 3, "a")["surface"] == {"sphere": {"radius": 3}}
    assert replaced(SCENE, "fluid.0.block.min.1", 5, "a")["fluid"] == [{"block": {"min": [0, 5, 0]}}]
    assert replaced(SCENE, "fps", 60, "a")["fps"] == 60  # a key that the scene leaves out
    assert SCENE["gravity"] == [0, 0, -9.81]


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("surfaces.cup.at.0", "a has no 'surfaces' there, but gravity, surface, fluid"),
        ("gravity.3", "a has the entries 0 to 2 there, no '3'"),
        ("gravity.z", "a has the entries 0 to 2 there, no 'z'"),
        ("surface.sphere.radius.0", "a has the value 0.2 there, which has no parts"),
    ],
)
def test_a_path_that_leads_nowhere_is_named(key, message):
    with pytest.raises(InputError, match=message):
        replaced(SCENE, key, 1, "a")
