"""Rigid bodies fall, touch, float and are moved by water."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.sph.environment import Environment

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
DROP = "fluid: [{block: {min: [-0.45, -0.45, 0.1], max: [-0.37, -0.37, 0.18]}}]\n"  # far from everything


def simulation_of(text):
    return sf.Simulation(Scene.from_yaml(text, "test"))


def corners(size, pose):
    signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
    return pose.apply(signs * size)


def test_a_body_in_the_air_falls_and_spins_freely():
    simulation = simulation_of(
        DROP + "surfaces: {ball: {sphere: {radius: 0.1}, at: [0, 0, 1.5], rigid_body: "
        "{velocity: [0.2, 0, 0], angular_velocity: [0, 3, 0]}}}"
    )
    start = simulation.frame.poses["ball"]
    for _ in range(40):
        frame = simulation.step()
    body, pose = simulation.state.bodies["ball"], frame.poses["ball"]
    np.testing.assert_allclose(body.velocity, [0.2, 0, -9.81 * 0.2], atol=1e-9)
    fall = 0.5 * 9.81 * 0.2 * (0.2 + 0.001)  # semi-implicit steps of 1 ms
    np.testing.assert_allclose(pose.position - start.position, [0.04, 0, -fall], atol=1e-6)
    turned = np.arctan2(pose.matrix[0, 2], pose.matrix[0, 0])
    assert turned == pytest.approx(3 * 0.2, abs=1e-3)


def test_the_spin_of_an_uneven_body_keeps_its_angular_momentum():
    simulation = simulation_of(
        "gravity: [0, 0, 0]\n"
        + DROP
        + "surfaces: {plate: {box: {size: [0.3, 0.2, 0.06]}, at: [0, 0, 1.5], rigid_body: "
        "{angular_velocity: [4, 0.1, 3]}}}"
    )
    body = simulation._bodies.bodies[0]

    def momentum():
        state = simulation.state.bodies["plate"]
        return body.inertia(state.pose) @ state.angular_velocity

    before = momentum()
    for _ in range(60):
        simulation.step()
    np.testing.assert_allclose(momentum(), before, atol=0.02 * np.linalg.norm(before))


def test_a_box_comes_to_rest_on_the_floor_and_a_second_one_on_it():
    simulation = simulation_of(
        DROP + "surfaces:\n  low: {box: {size: [0.3, 0.3, 0.1]}, at: [0, 0, 0.1], rigid_body: {density: 800}}\n"
        "  high: {box: {size: [0.2, 0.2, 0.1]}, at: [0.02, 0, 0.3], rigid_body: {density: 300}}\n"
    )
    for _ in range(100):
        frame = simulation.step()
        for name, size in (("low", (0.3, 0.3, 0.1)), ("high", (0.2, 0.2, 0.1))):
            assert corners(size, frame.poses[name])[:, 2].min() > -1e-3
    low, high = (frame.poses[name].position for name in ("low", "high"))
    assert low[2] == pytest.approx(0.05, abs=2e-3) and high[2] == pytest.approx(0.15, abs=4e-3)
    for body in simulation.state.bodies.values():
        assert np.linalg.norm(body.velocity) < 0.02 and np.linalg.norm(body.angular_velocity) < 0.2


def test_friction_stops_a_box_that_slides():
    simulation = simulation_of(
        DROP + "surfaces: {box: {box: {size: [0.2, 0.2, 0.1]}, at: [0, 0, 0.0505], rigid_body: {velocity: [1, 0, 0]}}}"
    )
    for _ in range(80):
        frame = simulation.step()
    assert 0.1 < frame.poses["box"].position[0] < 0.25  # v² / (2 μ g) is 0.17 m
    assert np.linalg.norm(simulation.state.bodies["box"].velocity) < 0.02


@pytest.mark.parametrize(("density", "draught"), [(300, 0.045), (700, 0.105)])
def test_a_box_floats_at_its_draught(density, draught):
    simulation = simulation_of(
        "container: {size: [0.48, 0.48, 0.6]}\n"
        "surfaces: {box: {box: {size: [0.24, 0.24, 0.15]}, at: [0, 0, 0.42], "
        f"rigid_body: {{density: {density}}}}}}}\n"
        "fluid: [{block: {min: [-0.22, -0.22, 0.02], max: [0.22, 0.22, 0.34]}}]\nforces: [box]"
    )
    for _ in range(150):
        simulation.step()
    bottoms, forces = [], []
    for _ in range(100):
        frame = simulation.step()
        bottoms.append(frame.poses["box"].position[2] - 0.075)
        forces.append(frame.forces["box"].force[2])
        assert frame.poses["box"].matrix[2, 2] > np.cos(np.radians(6))
    outside = np.abs(frame.positions[:, :2]).max(axis=1) > 0.15
    surface = np.quantile(frame.positions[outside, 2], 0.98) + 0.015  # half a spacing above the top layer
    assert surface - np.mean(bottoms) == pytest.approx(draught, abs=0.015)
    weight = density * 0.24**2 * 0.15 * 9.81
    assert np.mean(forces) == pytest.approx(weight, rel=0.06)
    assert np.std(forces) < 0.25 * weight  # it does not hammer


def test_a_state_holds_the_bodies_and_a_pose_that_is_set_drives_them():
    simulation = simulation_of(
        DROP + "surfaces: {ball: {sphere: {radius: 0.1}, at: [0, 0, 1.5], rigid_body: {velocity: [0.2, 0, 0]}}}"
    )
    for _ in range(5):
        simulation.step()
    middle = simulation.state
    first = [simulation.step().poses["ball"].position for _ in range(5)]
    simulation.reset(middle)
    again = [simulation.step().poses["ball"].position for _ in range(5)]
    np.testing.assert_array_equal(first, again)
    simulation.set_pose("ball", (0, 0, 1.4))
    np.testing.assert_array_equal(simulation.step().poses["ball"].position, [0, 0, 1.4])
    np.testing.assert_array_equal(simulation.step().poses["ball"].position, [0, 0, 1.4])


@pytest.mark.parametrize(
    ("surfaces", "message"),
    [
        ("low: {box: {size: [0.2, 0.2, 0.2]}, at: [0, 0, 0.05], rigid_body: {}}", "'low' .* begins 0.05 m outside the"),
        (
            "a: {box: {size: [0.2, 0.2, 0.2]}, at: [0, 0, 0.3]}, "
            "b: {sphere: {radius: 0.1}, at: [0, 0, 0.45], rigid_body: {}}",
            "'b' is a rigid body that begins .* inside 'a'; move it out",
        ),
        (
            "thin: {box: {size: [0.2, 0.2, 0.03]}, at: [0, 0, 0.3], rigid_body: {}}",
            "'thin' is flush, but thinner than 2.6",
        ),
    ],
)
def test_a_body_that_cannot_start_is_an_error_of_one_line(surfaces, message):
    with pytest.raises(InputError, match=message) as caught:
        simulation_of(DROP + f"surfaces: {{{surfaces}}}")
    assert "\n" not in str(caught.value)


def test_other_users_of_the_solver_refuse_rigid_bodies():
    scene = Scene.from_yaml(DROP + "surfaces: {b: {sphere: {radius: 0.1}, at: [0, 0, 1], rigid_body: {}}}", "test")
    with pytest.raises(InputError, match="'b' is a rigid body, which moves in 'surfsup simulate'"):
        Environment.of(scene, None).at_frame(0)


def test_a_rigid_body_keeps_its_pose_in_the_trajectory(tmp_path):
    path = tmp_path / "trajectory.h5"
    simulation_of(
        "frames: 6\n" + DROP + "surfaces: {b: {sphere: {radius: 0.1}, at: [0, 0, 1], rigid_body: {}}}"
    ).record(path)
    with sf.Trajectory(path) as trajectory:
        heights = [Pose.from_array(row).position[2] for row in trajectory.poses["b"]]
    assert heights[0] == 1 and all(np.diff(heights) < 0)
