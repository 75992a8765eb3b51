import numpy as np
import pytest

import surfsup as sf
from surfsup.errors import InputError
from surfsup.live.world import SOLID, LiveWorld
from surfsup.scene import Scene
from surfsup.scene.pose import Pose

SCENE = """
container: {size: [0.6, 0.6, 1]}
surface: {sphere: {radius: 0.1}, at: [0, 0, 0.1]}
fluid: [{block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.5]}}]
"""


@pytest.fixture
def world(tmp_path):
    world = LiveWorld(Scene.from_yaml(SCENE, "test"), tmp_path / "recordings")
    yield world
    world.stop_recording()


def count(world):
    return len(world.frame.positions)


def test_without_a_command_the_water_is_that_of_a_simulation(world):
    simulation = sf.Simulation(world.scene, device="cpu")
    simulation.set_pose(SOLID, (0, 0, 0.1))
    for _ in range(40):
        np.testing.assert_array_equal(world.step().positions, simulation.step().positions)


def test_water_is_poured_where_there_is_room(world):
    before = count(world)
    assert world.pour((0, 0, 0.8), (0.2, 0.2, 0.2)) == 125 and count(world) == before + 125
    assert world.pour((0, 0, 0.8), (0.2, 0.2, 0.2)) == 0, "water is there"
    assert world.pour((0, 0, 0.1), (0.15, 0.15, 0.15)) == 0, "the solid is there"
    assert world.pour((5, 0, 0.5), (0.2, 0.2, 0.2)) == 0, "outside of the container"
    for _ in range(60):
        frame = world.step()
    assert np.isfinite(frame.positions).all() and frame.positions[-125:, 2].mean() < 0.7
    distance = np.linalg.norm(frame.positions - [0, 0, 0.1], axis=1)
    assert distance.min() > 0.1


def test_too_much_water_is_refused_and_nothing_changes(world):
    before = count(world)
    with pytest.raises(InputError, match="too many to be live"):
        LiveWorld(Scene.from_yaml(SCENE.replace("size: [0.6, 0.6, 1]", "size: [9, 9, 9]"), "test"), None).pour(
            (0, 0, 4), (3, 3, 3)
        )
    with pytest.raises(InputError, match="too many to be live"):
        world.set_particle_radius(0.001)
    with pytest.raises(InputError, match="thick"):
        world.pour((0, 0, 0.8), (0.2, 0.2, 0.01))
    assert count(world) == before and world.scene.particle_radius == 0.015


def test_tilted_gravity_takes_the_water_aside_until_the_reset(world):
    world.set_gravity((9.81, 0, 0))
    for _ in range(30):
        frame = world.step()
    assert frame.velocities[:, 0].mean() > 1 and abs(frame.velocities[:, 2].mean()) < 0.1
    world.reset()
    for _ in range(10):
        frame = world.step()
    assert frame.velocities[:, 2].mean() < -0.3 and abs(frame.velocities[:, 0].mean()) < 0.1


def test_a_viscous_liquid_slows_down_until_the_reset(world):
    def energy() -> float:
        for _ in range(80):
            frame = world.step()
        return float((frame.velocities**2).sum(1).mean())

    thin = energy()
    world.reset()
    world.set_viscosity(1.0)
    assert energy() < 0.5 * thin
    world.reset()
    assert energy() == pytest.approx(thin)


def test_the_solid_follows_and_returns_at_a_reset(world):
    world.move(SOLID, Pose.of((0.1, 0, 0.1)))
    for _ in range(50):
        frame = world.step()
    np.testing.assert_allclose(frame.poses[SOLID].position, [0.1, 0, 0.1], atol=1e-9)
    world.reset()
    np.testing.assert_allclose(world.step().poses[SOLID].position, [0, 0, 0.1], atol=1e-9)


def test_particles_of_another_size_start_anew(world):
    world.set_gravity((0, 0, -5))
    before = count(world)
    world.set_particle_radius(0.01)
    assert count(world) > 2 * before and world.simulation.time == 0
    assert world.step().velocities[:, 2].mean() == pytest.approx(-5 * world.frame_time, rel=0.05)


def test_a_recording_is_a_trajectory_that_ends_with_a_reset(world):
    path = world.start_recording()
    for _ in range(5):
        frame = world.step()
    assert world.recording == path
    world.reset()
    assert world.recording is None
    with sf.Trajectory(path) as trajectory:
        assert len(trajectory) == 6 and trajectory.lifetimes is None
        np.testing.assert_array_equal(trajectory.positions[-1], frame.positions)
        assert list(trajectory.poses) == [SOLID]
    assert world.start_recording().name == "recording-002.h5", "no recording is replaced"


def test_water_that_is_poured_is_recorded_too(world):
    before, path = count(world), world.start_recording()
    frames = [world.step() for _ in range(3)]
    added = [world.pour((0, 0, z), (0.2, 0.2, 0.1)) for z in (0.8, 0.95)]
    world.move(SOLID, Pose.of((0.1, 0, 0.1)))
    frames += [world.step() for _ in range(5)]
    assert world.recording == path and world.stop_recording() == path
    assert [file.name for file in path.parent.iterdir()] == [path.name], "the files became one"
    with sf.Trajectory(path) as trajectory:
        assert len(trajectory) == 9 and trajectory.positions.shape[1] == before + sum(added)
        assert [len(trajectory.ids(frame)) for frame in range(9)] == [before] * 3 + [before + sum(added)] * 6
        for number, frame in enumerate(frames, start=1):
            # The poured water is there at the end of the frame before its first step.
            ids = slice(len(frame.positions))
            np.testing.assert_array_equal(trajectory.positions[number][ids], frame.positions)
            np.testing.assert_allclose(trajectory.velocities[number][ids], frame.velocities, atol=1e-5)
            np.testing.assert_allclose(trajectory.poses[SOLID][number], frame.poses[SOLID].array)
    with sf.Trajectory(path) as trajectory:
        assert np.isnan(trajectory.positions[2][before:]).all()


def test_a_recording_that_cannot_be_joined_keeps_its_parts(world):
    path = world.start_recording()
    world.pour((0, 0, 0.8), (0.2, 0.2, 0.1))
    world.step()

    path.mkdir()  # in the way
    with pytest.raises(
        InputError, match=r"cannot be written .* is in recording-001\.part-1\.h5 to recording-001\.part-2\.h5"
    ):
        world.stop_recording()
    for number in (1, 2):
        with sf.Trajectory(path.with_name(f"recording-001.part-{number}.h5")) as part:
            assert len(part) == number
    assert world.recording is None and world.start_recording().name == "recording-002.h5"


def test_an_unusable_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    world = LiveWorld(Scene.from_yaml(SCENE, "test"), tmp_path / "file")
    with pytest.raises(InputError, match="file: cannot be made"):
        world.start_recording()


def test_water_is_poured_beside_that_of_a_tap(tmp_path):
    tap = "taps: [{disc: {radius: 0.05}, at: [0.15, 0.15, 0.8], direction: [0, 0, -1], speed: 1}]\n"
    world = LiveWorld(Scene.from_yaml(SCENE + tap, "test"), tmp_path)
    start = count(world)
    for _ in range(20):
        world.step()
    entered = count(world) - start
    assert entered > 0
    assert world.pour((-0.15, -0.15, 0.7), (0.15, 0.15, 0.15)) > 0
    for _ in range(20):
        frame = world.step()
    assert np.isfinite(frame.positions).all() and count(world) > start + entered


def test_a_tap_gives_its_flow_until_it_is_closed(world):
    start = count(world)
    world.open_tap((0, 0, 0.8), 0.05, 5.0)
    for _ in range(100):
        frame = world.step()
    liters = (count(world) - start) * world.scene.spacing**3 * 1000
    assert liters == pytest.approx(0.5 * 5.0, abs=0.3)
    assert np.isfinite(frame.positions).all()

    before = count(world)
    world.open_tap((0.1, 0, 0.8), 0.05, 10.0)
    for _ in range(100):
        frame = world.step()
    assert (count(world) - before) * world.scene.spacing**3 * 1000 == pytest.approx(0.5 * 10.0, abs=0.3)
    young = frame.positions[-5:]
    np.testing.assert_allclose(young[:, :2].mean(0), [0.1, 0], atol=0.06)

    world.close_tap()
    before = count(world)
    for _ in range(20):
        world.step()
    assert count(world) == before and world.tap is None
    world.open_tap((0, 0, 0.8), 0.05, 5.0)
    world.reset()
    assert world.tap is None and count(world) == start
    world.step()
    assert count(world) == start


def test_a_tap_without_room_changes_nothing(world):
    world.open_tap((0, 0, 0.8), 0.05, 5.0)
    tap = world.tap
    for place, radius, message in [
        ((0, 0, 0.1), 0.05, "in a solid"),
        ((2, 0, 0.5), 0.05, "outside the container"),
        ((0, 0, 0.8), 0.01, "radius of 0.01 m is less"),
    ]:
        with pytest.raises(InputError, match=message):
            world.open_tap(place, radius, 5.0)
    before = count(world)
    for _ in range(50):
        world.step()
    assert world.tap is tap and count(world) > before


def test_a_tap_follows_the_solid_that_moved_away(world):
    world.move(SOLID, Pose.of((0.2, 0, 0.1)))
    for _ in range(60):
        world.step()
    world.open_tap((0, 0, 0.15), 0.04, 2.0)  # where the solid was
    with pytest.raises(InputError, match="in a solid"):
        world.open_tap((0.2, 0, 0.15), 0.04, 2.0)


def test_water_of_a_tap_is_recorded(world, monkeypatch):
    monkeypatch.setattr("surfsup.live.recording.ROOM", 20)
    monkeypatch.setattr("surfsup.live.recording.GROWTH", 0.0)
    path = world.start_recording()
    frames = [world.frame, world.step()]
    world.open_tap((0, 0, 0.8), 0.05, 10.0)
    for _ in range(60):
        frames.append(world.step())
    world.pour((0, 0, 0.6), (0.1, 0.1, 0.1))
    frames[-1] = world.frame
    frames.append(world.step())
    assert world.stop_recording() == path
    assert [file.name for file in path.parent.iterdir()] == [path.name], "the files became one"
    with sf.Trajectory(path) as trajectory:
        assert len(trajectory) == len(frames) and trajectory.positions.shape[1] == len(frames[-1].ids)
        for number, frame in enumerate(frames):
            np.testing.assert_array_equal(trajectory.ids(number), frame.ids)
            np.testing.assert_array_equal(trajectory.positions[number][frame.ids], frame.positions)


TWO_LIQUIDS = """
container: {size: [0.5, 0.5, 0.6]}
fluid:
- block: {min: [-0.2, -0.2, 0.02], max: [0.2, 0.2, 0.2]}
- {block: {min: [-0.2, -0.2, 0.22], max: [0, 0, 0.32]}, liquid: oil}
"""


def test_either_of_two_liquids_is_poured_and_comes_from_the_tap_and_is_recorded(tmp_path):
    world = LiveWorld(Scene.from_yaml(TWO_LIQUIDS, "test"), tmp_path)
    start = np.bincount(world.frame.liquids)
    world.start_recording()
    world.step()
    assert world.pour((0.12, 0.12, 0.45), (0.1, 0.1, 0.1), liquid=1) == 8
    assert world.pour((0.12, -0.12, 0.45), (0.1, 0.1, 0.1)) == 8
    np.testing.assert_array_equal(np.bincount(world.frame.liquids), start + 8)
    world.open_tap((-0.1, 0.1, 0.5), 0.05, 6.0, liquid=1)
    for _ in range(30):
        frame = world.step()
    water, oil = np.bincount(frame.liquids) - start
    assert water == 8 and oil > 8 + 10
    path = world.stop_recording()
    with sf.Trajectory(path) as trajectory:
        assert trajectory.scene.mixture == world.scene.mixture
        ids = trajectory.ids(len(trajectory) - 1)
        np.testing.assert_array_equal(trajectory.liquids[ids], frame.liquids)
    world.reset()
    np.testing.assert_array_equal(np.bincount(world.frame.liquids), start)
    world.set_particle_radius(0.02)
    assert set(world.frame.liquids) == {0, 1}
