"""Moving solids in the C++ solver."""

import copy
import warnings

import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup import native
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import PARTICLE_RADIUS, Scene
from surfsup.scene.pose import Pose
from surfsup.sph.collision import CLEARANCE
from surfsup.sph.native_solver import NativeSolver
from surfsup.sph.scene_motion import PoseJumpWarning
from surfsup.sph.solver import DfsphSolver

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
every_isa = pytest.mark.parametrize("isa", native.instruction_sets())
CUP = (
    "difference: [{cylinder: {radius: 0.12, height: 0.24}, at: [0, 0, 0.12]},"
    " {cylinder: {radius: %g, height: 1}, at: [0, 0, %g]}]"
)


def simulation_of(text, isa=None):
    solver = DfsphSolver()
    solver.native = NativeSolver(isa)
    return sf.Simulation(Scene.from_yaml(text, "test"), solver)


def line(start, velocity, seconds=100.0):
    """The motion from ``start`` at constant velocity."""
    end = np.add(start, np.multiply(velocity, seconds)).tolist()
    return f"{{between: linear, keyframes: [{{time: 0, position: {start}}}, {{time: {seconds}, position: {end}}}]}}"


def distances(simulation, frame, name):
    """Distance (N,) of the particles of a frame to a moving solid."""
    solid = next(solid for solid in simulation.motion.solids.moving if solid.name == name)
    own = frame.poses[name].to_own(frame.positions).astype(np.float32)
    return solid.surface.distance(torch.from_numpy(own)).numpy()


@every_isa
def test_a_scene_that_moves_as_a_whole_is_the_scene_at_rest(isa):
    velocity = (1.3, -0.7, 0.4)
    text = (
        "container: none\nsurfaces: {block: {box: {size: [0.3, 0.3, 0.1]}, at: [0, 0, 0.05]%s}}\n"
        "fluid: [{block: {min: [-0.12, -0.12, 0.14], max: [0.12, 0.12, 0.4], velocity: [%g, %g, %g]}}]"
    )
    still = simulation_of(text % ("", 0, 0, 0), isa)
    moved = simulation_of(text % (f", motion: {line([0, 0, 0.05], velocity)}", *velocity), isa)
    assert still.surface is not None and moved.surface is None
    for _ in range(15):
        here, there = still.step(), moved.step()
    np.testing.assert_allclose(there.positions, here.positions + np.array(velocity) * here.time, atol=2e-6)
    np.testing.assert_allclose(there.velocities, here.velocities + velocity, atol=2e-4)


def test_a_solid_that_moves_in_empty_space_leaves_the_water_alone():
    far = "fluid: [{block: {min: [0.2, 0.2, 1], max: [0.4, 0.4, 1.2]}}]\n"
    motion = "{spin: {axis: [0, 0, 1], turns: 1}}"
    alone = simulation_of(far)
    beside = simulation_of(
        far + f"surfaces: {{bar: {{box: {{size: [0.5, 0.1, 0.1]}}, at: [0, 0, 0.3], motion: {motion}}}}}"
    )
    for _ in range(20):
        here, there = alone.step(), beside.step()
    np.testing.assert_array_equal(here.positions, there.positions)


def test_a_particle_in_the_way_takes_on_the_velocity_of_the_solid():
    simulation = simulation_of(
        "container: none\ngravity: [0, 0, 0]\n"
        f"surfaces: {{wall: {{box: {{size: [1, 1, 0.1]}}, motion: {line([0, 0, 0], [0, 0, 2])}}}}}\n"
        "fluid: [{block: {min: [-0.03, -0.03, 0.1], max: [0.03, 0.03, 0.16]}}]"
    )
    assert len(simulation.particles.positions) == 1
    for _ in range(40):
        frame = simulation.step()
    assert 2.0 <= frame.velocities[0, 2] < 2.6  # pressure may throw it off a little faster
    np.testing.assert_allclose(frame.velocities[0, :2], 0, atol=1e-4)


@pytest.mark.parametrize("speed", [2.5, 14.0, 45.0])
def test_a_thin_plate_passes_no_particle(speed):
    simulation = simulation_of(
        "container: none\ngravity: [0, 0, 0]\n"
        f"surfaces: {{plate: {{box: {{size: [1.6, 1.6, 0.001]}}, motion: {line([0, 0, -0.05], [0, 0, speed])}}}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0], max: [0.1, 0.1, 0.12]}}]"
    )
    for _ in range(max(3, int(0.12 / speed / 0.005))):
        frame = simulation.step()
        above = frame.positions[:, 2] - frame.poses["plate"].position[2]
        assert (above[np.abs(frame.positions[:, :2]).max(axis=1) < 0.8] > 0.9 * CLEARANCE).all()


def test_fast_solids_get_pieces_of_at_most_a_particle_radius():
    simulation = simulation_of(
        f"surfaces: {{plate: {{box: {{size: [0.4, 0.4, 0.02]}}, motion: {line([0, 0, 0.1], [0, 0, 10.0])}}}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.1]}}]"
    )
    moving = simulation._environment.moving
    (plate,) = moving.bodies
    pieces = moving.of_frame(0).pieces()
    assert len(pieces) == 5 and sum(piece.seconds for piece in pieces) == pytest.approx(0.005)
    assert all(piece.displacements[0] <= PARTICLE_RADIUS for piece in pieces)
    slow = moving.between({"plate": Pose.of()}, {"plate": Pose.of((0, 0, PARTICLE_RADIUS))})
    assert plate.solid.name == "plate" and len(slow.pieces()) == 1


def test_a_piston_pushes_a_pool_and_no_particle_enters_it():
    simulation = simulation_of(
        "container: {size: [0.5, 0.3, 0.6]}\n"
        "surfaces: {piston: {box: {size: [0.1, 0.3, 0.5]},"
        f" motion: {line([-0.25, 0, 0.25], [0.4, 0, 0], 0.5)}}}}}\n"
        "fluid: [{block: {min: [-0.18, -0.13, 0.02], max: [0.23, 0.13, 0.16]}}]"
    )
    before = simulation.frame.positions[:, 0].mean()
    for _ in range(100):
        frame = simulation.step()
        assert distances(simulation, frame, "piston").min() > 0.9 * CLEARANCE
    assert frame.positions[:, 0].mean() > before + 0.08
    assert frame.positions[:, 0].min() > frame.poses["piston"].position[0] + 0.05  # none slipped behind it


@pytest.mark.parametrize("wall", [PARTICLE_RADIUS, 0.002])
def test_a_cup_keeps_its_water_when_carried_about(wall):
    simulation = simulation_of(
        f"container: {{size: [2, 2, 2]}}\nsurfaces:\n  cup:\n    {CUP % (0.12 - wall, 0.5 + wall)}\n"
        "    at: [-0.5, 0, 0.2]\n    motion: {keyframes: [{time: 0.1}, {time: 0.8, position: [0, 0.3, 0.7]},"
        " {time: 1.4, position: [0.5, 0, 0.3]}, {time: 2, position: [0, 0, 0.3]}]}\n"
        "fluid: [{block: {min: [-0.6, -0.1, 0.22], max: [-0.4, 0.1, 0.36]}}]"
    )
    assert len(simulation.particles.positions) > 60
    for _ in range(400):
        frame = simulation.step()
    own = frame.poses["cup"].to_own(frame.positions)
    inside = (np.hypot(own[:, 0], own[:, 1]) < 0.12) & (own[:, 2] > 0)
    assert inside.all() and distances(simulation, frame, "cup").min() > 0


def test_a_tilted_container_holds_its_water_and_the_water_runs_to_the_lower_side():
    turn = "{axis: [0, 1, 0], degrees: 25}"
    simulation = simulation_of(
        f"container: {{size: [0.5, 0.3, 0.5], motion: {{keyframes: [{{time: 0}}, {{time: 0.3, rotation: {turn}}}]}}}}\n"
        "fluid: [{block: {min: [-0.23, -0.13, 0.02], max: [0.23, 0.13, 0.12]}}]"
    )
    for _ in range(120):
        frame = simulation.step()
        own = frame.poses["container"].to_own(frame.positions)
        assert (np.abs(own[:, 0]) < 0.25).all() and (np.abs(own[:, 1]) < 0.15).all() and (own[:, 2] > 0).all()
    assert own[:, 0].mean() > 0.06  # the rotation lowers +x


def test_a_container_that_stands_still_as_a_moving_one_gives_the_same_to_rounding():
    water = "fluid: [{block: {min: [-0.23, -0.13, 0.02], max: [0.1, 0.13, 0.25]}}]\n"
    still = simulation_of(water + "container: {size: [0.5, 0.3, 0.5]}")
    moving = simulation_of(water + "container: {size: [0.5, 0.3, 0.5]}")
    moving.set_pose("container", (0, 0, 0))
    for _ in range(10):
        here, there = still.step(), moving.step()
    np.testing.assert_allclose(there.positions, here.positions, atol=1e-6)


class TestFromPython:
    TEXT = (
        "surfaces: {ball: {sphere: {radius: 0.1}, at: [0, 0, 0.3]}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]"
    )

    def test_a_pose_is_reached_by_the_end_of_the_next_step_and_kept(self):
        simulation = simulation_of(self.TEXT)
        assert simulation.frame.poses == {}
        simulation.set_pose("ball", (0.01, 0, 0.3), (2, 0, 0, 0))
        np.testing.assert_allclose(simulation.frame.poses["ball"].position, (0, 0, 0.3))
        for _ in range(2):
            np.testing.assert_allclose(simulation.step().poses["ball"].position, (0.01, 0, 0.3))

    def test_a_function_of_time_moves_a_solid(self):
        simulation = simulation_of(self.TEXT)
        simulation.set_motion("ball", lambda time: Pose.of((0.2 * time, 0, 0.3)))
        frames = [simulation.step() for _ in range(3)]
        assert frames[-1].poses["ball"].position[0] == pytest.approx(0.2 * frames[-1].time)

    def test_reset_returns_to_the_pose(self):
        simulation = simulation_of(self.TEXT)
        simulation.set_pose("ball", (0.01, 0, 0.3))
        before = simulation.state
        simulation.step()
        simulation.reset(before)
        np.testing.assert_allclose(simulation.frame.poses["ball"].position, (0, 0, 0.3))

    def test_frames_between_steps_have_poses_between(self):
        simulation = simulation_of(self.TEXT)
        simulation.set_motion("ball", lambda time: Pose.of((2 * time, 0, 0.3)))
        for frame in simulation.run(seconds=0.1, fps=60):
            assert frame.poses["ball"].position[0] == pytest.approx(2 * frame.time, abs=1e-9)
            assert distances(simulation, frame, "ball").min() > 0.9 * CLEARANCE

    def test_an_unknown_name_is_refused(self):
        with pytest.raises(InputError, match="there is no surface 'bal' to move; known are ball"):
            simulation_of(self.TEXT).set_pose("bal", (0, 0, 0))

    def test_a_jump_is_warned_of_with_its_frame(self):
        simulation = simulation_of(self.TEXT)
        simulation.step()
        simulation.set_pose("ball", (0, 0, 1.5))
        with pytest.warns(PoseJumpWarning, match="surface 'ball' moves 1.2 m in frame 2, at 240 m/s"):
            simulation.step()

    def test_what_the_file_of_a_trajectory_says_is_where_the_solid_was(self, tmp_path):
        simulation = simulation_of(self.TEXT)
        simulation.set_motion("ball", lambda time: Pose.of((0, 0, 0.3 + time)))
        simulation.record(tmp_path / "t.h5", seconds=0.1)
        with sf.Trajectory(tmp_path / "t.h5") as trajectory:
            np.testing.assert_allclose(trajectory.poses["ball"][:, 2], 0.3 + 0.005 * np.arange(20), atol=1e-12)


def test_other_simulators_refuse_moving_solids():
    text = (
        "surfaces: {ball: {sphere: {radius: 0.1}, motion: {spin: {rate: 1}}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]"
    )
    with pytest.raises(InputError, match="does not know moving solids"):
        sf.Simulation(Scene.from_yaml(text, "test"), "surfsup")


def test_a_closing_gap_squeezes_water_out_without_a_particle_inside():
    simulation = simulation_of(
        "container: {size: [0.8, 0.8, 0.6]}\n"
        f"surfaces: {{press: {{box: {{size: [0.3, 0.3, 0.1]}}, motion: {line([0, 0, 0.35], [0, 0, -1.0])}}}}}\n"
        "fluid: [{block: {min: [-0.12, -0.12, 0.02], max: [0.12, 0.12, 0.25]}}]"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(50):  # until it is two spacings above the floor
            frame = simulation.step()
            assert distances(simulation, frame, "press").min() > 0
            assert frame.positions[:, 2].min() > 0
    # The fastest has 25 to 56 m/s, by rounding, with different instruction sets; the mean is 5.5 to 6.4.
    speeds = np.linalg.norm(frame.velocities, axis=1)
    assert speeds.mean() < 10 and np.percentile(speeds, 99) < 30


class TestAgainstMistakes:
    TEXT = TestFromPython.TEXT

    def test_a_state_of_before_a_solid_could_move_has_it_at_rest(self):
        simulation = simulation_of(self.TEXT)
        before = simulation.state
        simulation.step()
        simulation.set_pose("ball", (0.01, 0, 0.3))
        simulation.reset(before)
        np.testing.assert_allclose(simulation.frame.poses["ball"].position, (0, 0, 0.3))
        np.testing.assert_allclose(simulation.step().poses["ball"].position, (0.01, 0, 0.3))

    def test_a_motion_that_returns_no_pose_is_refused(self):
        simulation = simulation_of(self.TEXT)
        simulation.set_motion("ball", lambda time: (0, 0, 0.3))
        with pytest.raises(InputError, match="the motion of 'ball' returned tuple, but must return a Pose"):
            simulation.step()

    def test_a_solid_too_large_for_a_map_is_refused(self):
        simulation = simulation_of(
            self.TEXT.replace("sphere: {radius: 0.1}", "box: {size: [20, 20, 1]}").replace("0.3", "-1")
        )
        simulation.set_pose("ball", (0, 0, -1))
        with pytest.raises(InputError, match="surface 'ball' is 20 x 20 x 1 m large, too large"):
            simulation.step()

    def test_a_simulation_is_copied_after_a_step(self):
        simulation = simulation_of(self.TEXT)
        simulation.set_motion("ball", lambda time: Pose.of((0.2 * time, 0, 0.3)))
        simulation.step()
        copied = copy.deepcopy(simulation)
        for _ in range(3):
            np.testing.assert_array_equal(copied.step().positions, simulation.step().positions)

    def test_a_motion_that_cannot_be_set_changes_nothing(self):
        simulation = sf.Simulation(Scene.from_yaml(self.TEXT, "test"), "surfsup", device="cpu")
        with pytest.raises(InputError, match="does not know moving solids"):
            simulation.set_pose("ball", (0, 0, 0.5))
        assert simulation.surface is not None and simulation.motion.solids.moving == ()
        assert simulation.step().poses == {}

    def test_a_reset_to_the_start_keeps_the_motions_that_were_set(self):
        simulation = simulation_of(self.TEXT)
        simulation.set_pose("ball", (0.01, 0, 0.3))
        simulation.step()
        simulation.reset()
        np.testing.assert_allclose(simulation.frame.poses["ball"].position, (0, 0, 0.3))
        np.testing.assert_allclose(simulation.step().poses["ball"].position, (0.01, 0, 0.3))

    def test_a_solid_may_begin_to_move_between_two_frames_of_a_run(self):
        simulation = simulation_of(self.TEXT)
        frames = simulation.run(seconds=0.1, fps=150)
        next(frames), next(frames)
        simulation.set_pose("ball", (0.01, 0, 0.3))
        for frame in frames:
            assert 0 <= frame.poses["ball"].position[0] <= 0.01

    def test_a_state_in_which_more_moves_is_refused(self):
        one, other = simulation_of(self.TEXT), simulation_of(self.TEXT)
        one.set_pose("ball", (0.01, 0, 0.3))
        with pytest.raises(InputError, match="'ball' moves in the state, but stands still in this simulation"):
            other.reset(one.state)

    def test_buffers_are_kept_of_the_latest_part_of_a_frame_alone(self):
        simulation = simulation_of(self.TEXT)
        for distance in (0.0, 0.02, 0.12, 0.0):
            simulation.set_pose("ball", (distance, 0, 0.3))
            simulation.step()
        assert len(simulation._simulator.native.solvers) == 2
