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


def bar(more: str) -> str:
    """A bar that falls from level about an axle at its end, at x = 0 and z = 1."""
    return (
        DROP + "surfaces:\n"
        "  bar: {box: {size: [0.4, 0.06, 0.06]}, at: [0.17, 0, 1], rigid_body: {density: 800, "
        "axle: {axis: [0, 1, 0], point: [0, 0, 1]}}}\n" + more
    )


def angle(simulation: sf.Simulation) -> float:
    """By which the bar hangs below level, degrees."""
    along = simulation.frame.poses["bar"].matrix[:, 0]
    return float(np.degrees(np.arctan2(-along[2], along[0])))


def test_a_bar_on_an_axle_comes_to_rest_on_what_is_below_it():
    post = "  post: {box: {size: [0.06, 0.1, 0.7]}, at: [0.25, 0, 0.5]}\n"
    simulation = simulation_of(bar(post))
    lowest = 0.0
    for _ in range(200):
        simulation.step()
        lowest = max(lowest, angle(simulation))
    # Its lower side on the corner (0.22, 0.85) of the post: 0.15 cos φ - 0.22 sin φ = 0.03. Contacts are 3 cm apart.
    assert angle(simulation) == pytest.approx(27.8, abs=3) and lowest < 32
    assert abs(simulation.state.bodies["bar"].angular_velocity[1]) < 0.02
    np.testing.assert_allclose(simulation.frame.poses["bar"].apply(np.array([[-0.17, 0, 0]]))[0], [0, 0, 1], atol=1e-9)


def test_a_bar_on_an_axle_turns_through_a_post_that_it_overlaps_and_is_stopped_by_another():
    through = "  pin: {cylinder: {radius: 0.02, height: 0.2}, at: [0, 0, 1]}\n"
    stop = "  post: {box: {size: [0.06, 0.1, 0.7]}, at: [0.25, 0, 0.5]}\n"
    free, stopped = simulation_of(bar(through)), simulation_of(bar(through + stop))
    for _ in range(90):
        free.step()
        stopped.step()
    assert angle(free) > 60 and angle(stopped) < 32


def test_a_free_ball_is_thrown_by_a_bar_and_slows_it():
    ball = "  ball: {sphere: {radius: 0.06}, at: [0.33, 0, 0.88], rigid_body: {density: 2000}}\n"
    alone, both = simulation_of(bar("")), simulation_of(bar(ball))
    for _ in range(45):
        alone.step()
        both.step()
    spins = [simulation.state.bodies["bar"].angular_velocity[1] for simulation in (alone, both)]
    assert spins[1] < spins[0] - 0.2 and both.state.bodies["ball"].velocity[2] < -9.81 * both.time - 0.05


def test_a_wall_stops_a_door():
    text = "container: {size: [0.5, 0.5, 0.6]}\n" + (
        "fluid: [{block: {min: [-0.24, -0.24, 0.02], max: [-0.14, -0.14, 0.12]}}]\n"
        "surfaces: {door: {box: {size: [0.3, 0.06, 0.3]}, at: [0.05, 0, 0.3], rigid_body: {density: 800, "
        "angular_velocity: [0, 0, 4], axle: {axis: [0, 0, 1], point: [-0.1, 0, 0]}}}}\n"
    )
    simulation = simulation_of(text)
    for _ in range(120):
        frame = simulation.step()
    corners = np.array([[x, y, z] for x in (-0.15, 0.15) for y in (-0.03, 0.03) for z in (-0.15, 0.15)])
    reached = frame.poses["door"].apply(corners)[:, 1].max()
    assert 0.23 < reached < 0.26 and abs(simulation.state.bodies["door"].angular_velocity[2]) < 0.05
