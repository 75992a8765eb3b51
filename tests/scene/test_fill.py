import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import SPACING, SURFACE_CLEARANCE, Fill, InitialParticles, Scene

BOWL = "surface: {{bowl: {{capture_radius: 0.3, filter_radius: {hole}}}, at: [0, 0, 0.36]}}\n"


def start_of(text: str) -> InitialParticles:
    scene = Scene.from_yaml(text, "scene.yaml")
    return scene.initial_particles(scene.build_surface())


def filled_bowl(keys: str, hole: float = 0.0) -> InitialParticles:
    return start_of(BOWL.format(hole=hole) + f"fluid: [{{fill: {{{keys}}}}}]")


def test_a_shape_of_water_holds_as_many_particles_as_its_volume():
    start = start_of("fluid: [{fill: {surface: {sphere: {radius: 0.3}, at: [0.1, 0, 1]}, velocity: [1, 0, 0]}}]")
    assert len(start.positions) == pytest.approx(4 / 3 * np.pi * 0.3**3 / SPACING**3, rel=0.02)
    distance = np.linalg.norm(start.positions - [0.1, 0, 1], axis=1)
    assert distance.max() <= 0.3 + 1e-6
    assert torch.pdist(torch.from_numpy(start.positions)).min() > 0.99 * SPACING
    np.testing.assert_array_equal(start.velocities, np.broadcast_to([1.0, 0, 0], start.velocities.shape))


def test_a_shape_is_cut_at_the_level_and_at_the_solid():
    text = "fluid: [{fill: {surface: {sphere: {radius: 0.3}, at: [0, 0, 1]}, below: 1.05}}]\n"
    assert start_of(text).positions[:, 2].max() == pytest.approx(1.05 - SPACING / 2)
    start = start_of(text + "surface: {box: {size: [1, 1, 0.4]}, at: [0, 0, 0.7]}")
    assert start.excluded > 0
    assert start.positions[:, 2].min() >= 0.9 + SURFACE_CLEARANCE


def test_a_vessel_is_filled_up_to_the_level():
    start = filled_bowl("below: 0.3")
    x, y, z = start.positions.T
    assert z.max() == pytest.approx(0.3 - SPACING / 2)
    assert np.sqrt(x**2 + y**2 + (z - 0.36) ** 2).max() <= 0.3 - SURFACE_CLEARANCE + 1e-6
    volume = np.pi * 0.24**2 * (0.9 - 0.24) / 3
    assert 0.7 < len(start.positions) * SPACING**3 / volume < 1  # the lattice keeps its distance from the wall
    np.testing.assert_array_equal(filled_bowl("below: 0.3, seed: [0, 0, 0.2]").positions, start.positions)


def test_a_seed_chooses_one_of_two_vessels():
    half = "bowl: {capture_radius: 0.18}"
    text = (
        f"surface: {{union: [{{{half}, at: [-0.25, 0, 0.3]}}, {{{half}, at: [0.25, 0, 0.3]}}]}}\n"
        "fluid: [{fill: {below: 0.28%s}}]"
    )
    both, right = start_of(text % "").positions, start_of(text % ", seed: [0.25, 0, 0.2]").positions
    assert right[:, 0].min() > 0 and len(both) == 2 * len(right)


def test_a_vessel_of_small_particles_is_the_small_copy_of_a_large_one():
    text = (
        "container: {{size: [{0}, {0}, {0}]}}\nparticle_radius: {1}\n"
        "surface: {{bowl: {{capture_radius: {2}, wall: {3}}}, at: [0, 0, {4}]}}\nfluid: [{{fill: {{below: {5}}}}}]"
    )
    large = start_of(text.format(1.0, 0.015, 0.3, 0.04, 0.36, 0.3)).positions
    small = start_of(text.format(0.25, 0.00375, 0.075, 0.01, 0.09, 0.075)).positions
    np.testing.assert_allclose(4 * small, large, atol=1e-6)


@pytest.mark.parametrize(
    ("keys", "hole", "message"),
    [
        ("below: 0.3", 0.05, r"holds no water below 0\.3 m: .* a seed, a point in the hollow, makes the message say"),
        (
            "below: 0.3, seed: [0, 0, 0.2]",
            0.05,
            r"is open below 0\.3 m: water would run out near \(\S+, \S+, 0\.0\d+\)",
        ),
        ("below: 0.5, seed: [0, 0, 0.2]", 0.0, r"water would run out near \(\S+, \S+, 0\.4\d*\) m; lower the level"),
        ("below: 0.3, seed: [0.45, 0, 0.2]", 0.0, r"the seed \(0\.45, 0, 0\.2\) is outside the solid, which reaches"),
        ("below: 0.3, seed: [0, 0, 0.35]", 0.0, r"the seed \(0, 0, 0\.35\) is above the level of 0\.3 m"),
        ("below: 0.3, seed: [0.3, 0, 0.29]", 0.0, "is inside the solid, or closer to it than a particle"),
        ("below: 0.01", 0.0, r"nothing holds water below 0\.01 m: the solid begins at 0\.02 m"),
        ("surface: {sphere: {radius: 0.2}, at: [0, 0, 1]}, below: 0.5", 0.0, r"holds no particle below 0\.5 m"),
        ("surface: {sphere: {radius: 0.2}, at: [0.4, 0, 1]}", 0.0, "reaches from .* along x, outside the container"),
        (
            "surface: {sphere: {radius: 0.02}, at: [0, 0.32, 0.3]}",
            0.0,
            "all 1 particles are inside the solid; move the fill",
        ),
    ],
)
def test_a_region_that_cannot_be_filled_is_an_error_of_one_line(keys, hole, message):
    with pytest.raises(InputError, match=message) as error:
        filled_bowl(keys, hole)
    assert "\n" not in str(error.value)


def test_a_vessel_needs_a_solid():
    with pytest.raises(InputError, match="needs a vessel, but the scene has no solid"):
        start_of("fluid: [{fill: {below: 0.3}}]")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "needs a surface .* or below"),
        ({"surface": {"sphere": {"radius": 1}}, "seed": (0, 0, 0)}, "takes a seed only without a surface"),
        ({"below": float("nan")}, "below: Input should be a finite number"),
    ],
)
def test_contradictory_keys_are_an_error_of_one_line(keys, message):
    with pytest.raises(InputError, match=message) as error:
        Fill(**keys)
    assert "\n" not in str(error.value)
