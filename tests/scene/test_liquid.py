"""The key ``liquid`` of a scene."""

import pytest

from surfsup.errors import InputError
from surfsup.scene import Liquid, Scene, Units
from surfsup.scene.liquid import LIQUIDS

FLUID = "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\n"


def scene(text):
    return Scene.from_yaml(FLUID + text, "test")


@pytest.mark.parametrize("name", LIQUIDS)
def test_a_liquid_may_be_given_by_its_name(name):
    named = scene(f"liquid: {name}")
    assert named.liquid == LIQUIDS[name]
    assert named.density == LIQUIDS[name].density
    assert Scene(fluid=named.fluid, liquid=name) == Scene(fluid=named.fluid, liquid=LIQUIDS[name])


def test_a_scene_keeps_its_liquid():
    original = scene("liquid: {viscosity: 1.0e-3, surface_tension: 0.06, adhesion: 0.01, friction: 0.5, density: 1261}")
    assert original.liquid == Liquid(0.001, 0.06, 0.01, 0.5, 1261) and original.density == 1261
    assert Scene.from_yaml(original.to_yaml(), "copy") == original
    assert original.with_changes(frames=7).liquid == original.liquid


def test_without_the_key_nothing_is_written_and_nothing_changes():
    plain = scene("")
    assert plain.liquid is None and plain.density == 1000 and not plain.needs_native
    assert "liquid" not in plain.to_yaml() and "density" not in plain.to_yaml()


def test_froude_similarity_scales_viscosity_by_the_power_one_and_a_half_and_tension_by_the_square():
    liquid = Liquid(viscosity=0.8, surface_tension=1.6, adhesion=0.8, friction=0.5, density=900)
    scaled = Units(0.06).liquid_to_solver(liquid)
    assert scaled == Liquid(viscosity=0.1, surface_tension=0.1, adhesion=0.05, friction=0.5, density=900)
    assert Units(0.06).liquid_to_solver(Liquid()) == Liquid()
    assert Units(0.015).liquid_to_solver(liquid) is liquid


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("liquid: hony", r"^test: liquid: there is no liquid 'hony'; did you mean 'honey'\?"),
        ("liquid: mercury", "there is no liquid 'mercury'; known are water, oil, glycerin, honey"),
        ("liquid: {viscosity: -1}", "liquid.viscosity: Input should be greater than or equal to 0"),
        ("liquid: {viscosity: .nan}", "liquid.viscosity"),
        ("liquid: {viscosity: .inf}", "liquid.viscosity"),
        ("liquid: {viscosty: 1}", "unknown key 'liquid.viscosty'; did you mean 'viscosity'"),
        ("liquid: {surface_tension: -0.1}", "liquid.surface_tension"),
        ("liquid: {adhesion: -0.1}", "liquid.adhesion"),
        ("liquid: {friction: 1.1}", "liquid.friction"),
        ("liquid: {density: 0}", "liquid.density"),
        ("liquid: 3", "liquid: must be a name out of water, oil, glycerin, honey, or a mapping"),
        ("liquid: honey\ndensity: 1000", "density: 1000 contradicts that of the liquid, 1420 kg/m³"),
    ],
)
def test_what_cannot_be_is_an_error_of_one_line(text, message):
    with pytest.raises(InputError, match=message) as caught:
        scene(text)
    assert "\n" not in str(caught.value)


def test_in_python_an_unknown_name_is_an_error_too():
    with pytest.raises(InputError, match="did you mean 'glycerin'"):
        Scene(fluid=scene("").fluid, liquid="glycerine")
