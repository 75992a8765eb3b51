"""What a scene says of rigid bodies, and their mass."""

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.rigid_body import MassProperties, RigidBody
from surfsup.sdf import Box, Difference, Sphere, Surface, Transformed

FLUID = "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\n"
BOAT = FLUID + "surfaces: {boat: {box: {size: [0.2, 0.2, 0.2]}, at: [0, 0, 0.3], %s}}"


def scene(text):
    return Scene.from_yaml(text, "test")


def test_a_box_has_its_mass_center_and_moments_of_inertia():
    size = np.array([0.3, 0.2, 0.1])
    box = Transformed(Box(tuple(size)), translation=(0.1, -0.05, 0.2))
    found = MassProperties.of(RigidBody(density=600), box, "box")
    mass = 600 * size.prod()
    assert found.volume == pytest.approx(size.prod(), rel=2e-3)
    assert found.mass == pytest.approx(mass, rel=2e-3)
    np.testing.assert_allclose(found.center, [0.1, -0.05, 0.2], atol=1e-6)
    moments = mass / 12 * (np.sum(size**2) - size**2)
    np.testing.assert_allclose(found.inertia, np.diag(moments), rtol=5e-3, atol=1e-6)


def test_a_ball_has_its_mass_and_moments_of_inertia():
    found = MassProperties.of(RigidBody(mass=3.0), Sphere(0.15), "ball")
    assert found.volume == pytest.approx(4 / 3 * np.pi * 0.15**3, rel=2e-3) and found.mass == 3.0
    np.testing.assert_allclose(found.inertia, 0.4 * 3 * 0.15**2 * np.eye(3), rtol=5e-3, atol=1e-6)


def test_values_that_are_given_replace_those_of_the_volume():
    body = RigidBody(mass=2.0, center_of_mass=(0, 0, -0.05), inertia=(0.1, 0.2, 0.15))
    found = MassProperties.of(body, Sphere(0.1), "ball")
    np.testing.assert_array_equal(found.center, [0, 0, -0.05])
    np.testing.assert_array_equal(found.inertia, np.diag([0.1, 0.2, 0.15]))


def test_a_body_without_volume_is_an_error_of_one_line():
    class Nothing(Surface):
        def distance(self, points):
            return points.norm(dim=1) + 0.01

        def bounds(self):
            return Sphere(0.1).bounds()

    empty = Difference(Sphere(0.1), Sphere(0.3))
    for surface in (Nothing(), empty):
        with pytest.raises(InputError, match="surface 'boat' is a rigid body, but encloses no volume") as caught:
            MassProperties.of(RigidBody(), surface, "boat")
        assert "\n" not in str(caught.value)


def test_a_scene_keeps_its_rigid_bodies():
    original = scene(BOAT % "rigid_body: {density: 300, velocity: [0, 0, -1]}")
    assert Scene.from_yaml(original.to_yaml(), "copy") == original
    assert original.moves and not scene(BOAT % "scale: 1").moves


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("rigid_body: {density: 500, mass: 1}", "give either density or mass, not both"),
        ("rigid_body: {mass: 0}", "mass"),
        ("rigid_body: {density: -1}", "density"),
        ("rigid_body: {inertia: [1, 1, 3]}", "no moment may exceed the sum of the other two"),
        ("rigid_body: {}, motion: {spin: {turns: 1}}", "give either motion or rigid_body, not both"),
    ],
)
def test_a_body_that_cannot_be_is_an_error_of_one_line(keys, message):
    with pytest.raises(InputError, match=message) as caught:
        scene(BOAT % keys)
    assert "\n" not in str(caught.value)
