"""A body on an axle: a pendulum, and a wheel that a tap turns."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
DROP = "fluid: [{block: {min: [-0.45, -0.45, 0.1], max: [-0.37, -0.37, 0.18]}}]\n"  # far from everything


def simulation_of(text):
    return sf.Simulation(Scene.from_yaml(text, "test"))


def test_a_pendulum_swings_at_its_period_about_a_point_that_stays():
    simulation = simulation_of(
        DROP + "surfaces: {bar: {box: {size: [0.06, 0.06, 0.4]}, at: [0.02, 0, 1.2],"
        " rigid_body: {density: 800, axle: {axis: [0, 2, 0], point: [0, 0, 1.35]}}}}"
    )
    body = simulation._bodies.bodies[0]
    pivot = simulation.frame.poses["bar"].to_own(np.array([[0, 0, 1.35]]))
    times, spins = [], []
    for _ in range(260):
        frame = simulation.step()
        times.append(frame.time)
        spins.append(simulation.state.bodies["bar"].angular_velocity[1])
        np.testing.assert_allclose(frame.poses["bar"].apply(pivot)[0], [0, 0, 1.35], atol=1e-9)
    turns = np.array(times)[1:][np.diff(np.sign(spins)) != 0]
    arm = np.linalg.norm(body.mass.center - pivot[0])
    inertia = body.mass.inertia[1, 1] + body.mass.mass * arm**2
    expected = 2 * np.pi * np.sqrt(inertia / (body.mass.mass * 9.81 * arm))
    assert np.diff(turns).mean() == pytest.approx(expected / 2, rel=0.02)
    assert np.abs(spins).max() > 0.1


WHEEL = """
container: {size: [0.8, 0.3, 1]}
particle_radius: 0.015
surfaces:
  wheel:
    union: [{box: {size: [0.5, 0.2, 0.06]}}, {box: {size: [0.06, 0.2, 0.5]}}]
    at: [0, 0, 0.4]
    flush: false
    rigid_body: {density: 600, axle: {axis: [0, 1, 0], damping: 0.2}}
taps: [{rectangle: {size: [0.12, 0.12]}, at: [0.15, 0, 0.85], speed: 1}]
drains: [{box: {size: [0.8, 0.3, 0.1]}}]
forces: all
"""


def test_a_tap_turns_a_wheel_and_gives_what_it_gives_without():
    simulation = simulation_of(WHEEL)
    alone = sf.Simulation(Scene.from_yaml(WHEEL.replace("rigid_body: {density: 600, axle", "#"), "test"))
    for _ in range(160):
        frame, other = simulation.step(), alone.step()
    assert frame.ids[-1] == other.ids[-1]  # the same flow, though a frame is computed in five parts
    assert simulation.state.bodies["wheel"].angular_velocity[1] > 1
    np.testing.assert_allclose(frame.poses["wheel"].position, [0, 0, 0.4], atol=1e-4)
    turned = frame.poses["wheel"].matrix
    assert turned[1, 1] == pytest.approx(1) and turned[0, 0] != pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("{axle: {axis: [0, 0, 0]}}", "axis must not be zero"),
        ("{axle: {axis: [0, 0, 1]}, velocity: [1, 0, 0]}", "a body on an axle has no velocity of its own"),
        ("{axle: {axis: [0, 0, 1], damping: -1}}", "damping"),
    ],
)
def test_what_no_axle_is_is_refused(body, message):
    with pytest.raises(InputError, match=message):
        simulation_of(DROP + f"surfaces: {{a: {{sphere: {{radius: 0.1}}, at: [0, 0, 1], rigid_body: {body}}}}}")
