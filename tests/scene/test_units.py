import math

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Block, Container, Scene, Units
from surfsup.scene.pose import Pose
from surfsup.scene.solids import MovingSolid, Solids
from surfsup.sdf import Sphere, Transformed
from surfsup.simulation import Simulation
from tests.scene.similar import similar_scene

FACTORS = (1 / 15, 1 / 3, 2.0, 20 / 3)


def test_the_standard_radius_changes_nothing():
    scene = similar_scene(1.0)
    units = scene.units
    assert units.same and units.scene_to_solver(scene) is scene
    start = scene.initial_particles(None)
    assert units.particles_to_solver(start) is start
    ball = Sphere(0.2)
    assert units.surface_to_solver(ball) is ball
    solids = Solids(ball)
    assert units.solids_to_solver(solids) is solids


@pytest.mark.parametrize("factor", FACTORS)
def test_froude_and_reynolds_number_are_the_same_in_both_units(factor):
    units = Units(factor * PARTICLE_RADIUS)
    assert units.velocity**2 / units.length == pytest.approx(1.0)
    assert units.velocity * units.length / units.viscosity == pytest.approx(1.0)
    assert units.length / units.time == pytest.approx(units.velocity)
    assert units.frame_time == pytest.approx(FRAME_TIME * math.sqrt(factor))


@pytest.mark.parametrize("factor", FACTORS)
def test_similar_scenes_are_one_scene_in_the_units_of_the_solver(factor):
    scene, standard = similar_scene(factor), similar_scene(1.0)
    converted = scene.units.scene_to_solver(scene)
    np.testing.assert_allclose(converted.container.size, standard.container.size)
    assert converted.particle_radius == PARTICLE_RADIUS and converted.frames == standard.frames
    assert converted.frame_time == pytest.approx(standard.frame_time)
    points = torch.rand(500, 3, generator=torch.Generator().manual_seed(1))
    expected = standard.build_surface().distance(points)
    solid = scene.units.surface_to_solver(scene.build_surface())
    torch.testing.assert_close(solid.distance(points), expected, rtol=1e-4, atol=1e-6)
    own = scene.build_surface().distance(factor * points)
    torch.testing.assert_close(own, factor * expected, rtol=1e-4, atol=1e-6 * factor)
    start = scene.units.particles_to_solver(scene.initial_particles(scene.build_surface()))
    original = standard.initial_particles(standard.build_surface())
    np.testing.assert_allclose(start.positions, original.positions, atol=1e-6)
    np.testing.assert_allclose(start.velocities, original.velocities, atol=1e-6)
    assert start.excluded == original.excluded > 0


def test_a_surface_object_is_scaled_too():
    surface = Units(0.06).surface_to_solver(Sphere(0.5))
    assert surface.distance(torch.zeros(1, 3)).item() == pytest.approx(-0.125)


def test_a_solid_moves_alike_in_both_units_from_the_time_at_which_the_scene_begins():
    spin = Solids(None, (MovingSolid("paddle", Sphere(0.5), lambda time: Pose.of((4 * time, 0, 1))),))
    (paddle,) = Units(0.06).solids_to_solver(spin, start_time=1.0).moving
    np.testing.assert_allclose(paddle.pose(0.0).position, [1.0, 0, 0.25])
    np.testing.assert_allclose(paddle.pose(0.5).position, [2.0, 0, 0.25])  # a second of the scene later
    assert paddle.surface.distance(torch.zeros(1, 3)).item() == pytest.approx(-0.125)


def test_frames_and_particles_return_to_the_units_of_the_scene():
    scene = similar_scene(1 / 3)
    start = scene.initial_particles(None)
    back = scene.units.particles_from_solver(scene.units.particles_to_solver(start))
    np.testing.assert_allclose(back.positions, start.positions, rtol=1e-6)
    np.testing.assert_allclose(back.velocities, start.velocities, rtol=1e-6)
    positions, velocities = scene.units.frame_from_solver(np.ones((1, 3), np.float32), np.ones((1, 3), np.float32))
    assert positions[0, 0] == pytest.approx(1 / 3) and velocities[0, 0] == pytest.approx(math.sqrt(1 / 3))
    assert positions.dtype == velocities.dtype == np.float32


@pytest.mark.parametrize("radius", [0.0009, 0.11, 0.0, -1.0])
def test_a_radius_out_of_range_is_an_error_of_one_line(radius):
    with pytest.raises(InputError, match=r"particle_radius: must be from 0\.001 to 0\.1 m \(found") as error:
        Scene(fluid=[Block((0, 0, 1), (1, 1, 2))], particle_radius=radius)
    assert "\n" not in str(error.value)


def test_a_block_is_filled_with_the_spacing_of_its_particles():
    scene = Scene(
        fluid=[Block((-0.05, -0.05, 0.1), (0.05, 0.05, 0.2))], container=Container(size=(0.2, 0.2, 0.3)),
        particle_radius=0.005,
    )  # fmt: skip
    assert len(scene.initial_particles(None).positions) == 9**3
    with pytest.raises(
        InputError, match=r"fluid\.0\.block: block is 0\.1 m thick along x: it must be at least 0\.12 m"
    ):
        scene.with_changes(particle_radius=0.03)


def test_a_duration_and_a_rate_give_the_number_of_frames():
    block = Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))
    assert Scene(fluid=[block]).frame_time == FRAME_TIME
    assert Scene(fluid=[block], duration=4).frames == 800
    assert Scene(fluid=[block], duration=4, fps=60).frames == 240
    assert Scene(fluid=[block], duration=4, particle_radius=0.00375).frames == 1600
    assert Scene(fluid=[block], fps=50, frames=7).frame_time == pytest.approx(0.02)
    assert Scene(fluid=[block], duration=4, fps=60, frames=240).frames == 240


def test_a_scene_with_a_duration_round_trips_through_yaml_and_takes_other_values():
    scene = Scene(fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], duration=2, fps=60)
    assert Scene.from_yaml(scene.to_yaml(), "scene.yaml") == scene
    assert scene.with_changes(fps=30).frames == 60
    assert scene.with_changes(frames=7).duration is None
    assert scene.with_frames(7).with_changes(fps=30).frames == 7
    assert scene.with_changes(duration=1.0).frames == 60
    assert scene.with_changes() is scene


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"frames": 100, "duration": 4.0},
            "frames: 100 contradicts a duration of 4 s, which has 800 frames of 0.005 s",
        ),
        ({"fps": 201.0}, "fps: must be at most 200 with particles of radius 0.015 m"),
        ({"fps": 120.0, "particle_radius": 0.1}, "fps: must be at most 77.46 with particles of radius 0.1 m"),
        ({"fps": 0.0}, "fps: Input should be greater than 0"),
        ({"duration": float("inf")}, "duration: Input should be a finite number"),
    ],
)
def test_a_contradiction_is_an_error_of_one_line(values, message):
    with pytest.raises(InputError, match=message) as error:
        Scene(fluid=[Block((-0.2, -0.2, 0.5), (0.2, 0.2, 0.9))], **values)
    assert "\n" not in str(error.value)


def test_water_far_from_the_origin_is_simulated_near_it_and_written_where_it_is():
    far = np.array([2345.0, -7890.0, 1000.0])
    text = (
        "container: none\nframes: 9\n"
        "surface: {{union: [{{sphere: {{radius: 0.2}}, at: {at}}}, {{box: {{size: [0.2, 0.2, 0.2]}}, at: {at}}}]}}\n"
        "fluid: [{{block: {{min: {lower}, max: {upper}}}}}]\n"
    )
    results = []
    for place in (np.zeros(3), far):
        box = {"lower": (place - (0.1, 0.1, -0.23)).tolist(), "upper": np.add(place, (0.1, 0.1, 0.4)).tolist()}
        scene = Scene.from_yaml(text.format(at=place.tolist(), **box), "test")
        simulation = Simulation(scene, device="cpu")
        *_, last = simulation.run()
        results.append(last.positions - place)
        assert np.abs(simulation.state.fluid.positions.numpy()).max() < 3
    # The lattice of the start is in single precision, 0.5 mm apart at 8 km, and splashes amplify it.
    np.testing.assert_allclose(results[1], results[0], atol=6e-3)


def test_an_origin_moves_positions_and_poses_and_comes_back():
    scene = Scene.from_yaml("container: none\nfluid: [{block: {min: [900, 0, 0], max: [900.3, 0.3, 0.3]}}]\n", "test")
    start = scene.initial_particles(None)
    units = Units(2 * PARTICLE_RADIUS).around(scene, start)
    assert units.origin == (900.0, 0.0, 0.0)
    near = units.particles_to_solver(start)
    np.testing.assert_allclose(near.positions, (start.positions - np.array(units.origin)) / 2, atol=1e-6)
    np.testing.assert_array_equal(units.particles_from_solver(near).positions, start.positions)
    np.testing.assert_allclose(units.pose_to_solver(Pose.of((901, 2, 3))).position, [0.5, 1, 1.5])
    ball = units.surface_to_solver(Transformed(Sphere(0.2), translation=(900.0, 0.0, 0.0)))
    assert ball.distance(torch.zeros(1, 3)).item() == pytest.approx(-0.1, abs=1e-6)
    assert scene.units.around(scene.model_copy(update={"container": Container()}), start) == scene.units
