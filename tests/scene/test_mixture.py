"""Scenes of several liquids."""

import pytest

from surfsup.errors import InputError
from surfsup.scene import Liquid, Scene, Units
from surfsup.scene.liquid import LIQUIDS

TEXT = """
fluid:
  - {block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}, liquid: oil}
  - block: {min: [-0.1, -0.1, 1.2], max: [0.1, 0.1, 1.4]}
  - {block: {min: [-0.1, -0.1, 1.4], max: [0.1, 0.1, 1.6]}, liquid: {density: 1300}}
  - {block: {min: [-0.1, -0.1, 1.6], max: [0.1, 0.1, 1.8]}, liquid: oil}
"""


def test_entries_of_the_fluid_have_liquids_of_their_own():
    scene = Scene.from_yaml(TEXT, "test")
    assert scene.mixture == (LIQUIDS["oil"], Liquid(), Liquid(density=1300))
    assert scene.needs_native and scene.density == 1000
    particles = scene.initial_particles(None)
    counts = [len(block) for block in particles.block_positions]
    assert list(particles.liquids) == [0] * counts[0] + [1] * counts[1] + [2] * counts[2] + [0] * counts[3]
    assert Scene.from_yaml(scene.to_yaml(), "copy") == scene


def test_a_scene_of_one_liquid_has_no_mixture():
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\nliquid: oil", "test")
    assert scene.mixture == () and scene.initial_particles(None).liquids is None


def test_a_tap_has_a_liquid_of_its_own():
    tap = "taps: [{disc: {radius: 0.05}, at: [0, 0, 1.9], speed: 1, liquid: honey}]"
    assert Scene.from_yaml(TEXT + tap, "test").mixture[-1] == LIQUIDS["honey"]


def test_the_liquids_of_a_mixture_scale_as_one_does():
    scene = Scene.from_yaml(TEXT, "test").with_changes(particle_radius=0.03)
    scaled = Units(0.03).scene_to_solver(scene).mixture
    assert scaled == tuple(Units(0.03).liquid_to_solver(liquid) for liquid in scene.mixture)


def test_an_unknown_liquid_is_named_with_its_entry():
    with pytest.raises(InputError, match=r"fluid\.0\.liquid: there is no liquid 'oli'; did you mean 'oil'\?"):
        Scene.from_yaml(TEXT.replace("liquid: oil", "liquid: oli", 1), "test")
