from dataclasses import replace

import numpy as np
import pytest
import torch

from surfsup import Block, Frame, InputError, Liquid, Scene, Simulation, Sphere, Trajectory, Transformed
from surfsup.native.dispatch import is_built
from surfsup.scene import FRAME_TIME, Tap
from surfsup.sph.collision import CLEARANCE
from surfsup.sph.state import ParticleState
from tests.scene.similar import similar_scene

BALL = Transformed(Sphere(0.2), translation=(0.0, 0.0, 0.2))
SCENE = Scene(surface=BALL, fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=40)


def simulation_of(**options: object) -> Simulation:
    return Simulation(SCENE, device="cpu", **options)


def test_by_default_a_run_has_the_frames_of_the_scene():
    simulation = simulation_of()
    frames = list(simulation.run())
    assert len(frames) == 40
    np.testing.assert_allclose([frame.time for frame in frames], FRAME_TIME * np.arange(40))
    assert frames[0].positions.dtype == frames[0].velocities.dtype == np.float32
    np.testing.assert_array_equal(frames[0].positions, simulation.particles.positions)
    assert simulation.time == pytest.approx(40 * FRAME_TIME)


@pytest.mark.parametrize(("seconds", "fps", "count"), [(0.1, 200, 20), (0.1, 60, 6), (0.1, 24, 3), (1 / 24, 24, 1)])
def test_a_run_has_the_requested_frames_and_ends_at_the_requested_time(seconds, fps, count):
    simulation = simulation_of()
    times = [frame.time for frame in simulation.run(seconds, fps)]
    np.testing.assert_allclose(times, np.arange(count) / fps, atol=1e-9)
    assert simulation.time == pytest.approx(seconds, abs=FRAME_TIME)
    assert simulation.time >= seconds - 1e-9


def test_consecutive_runs_equal_one_run():
    whole = list(simulation_of().run(0.1))
    parts = simulation_of()
    halves = [*parts.run(0.05), *parts.run(0.05)]
    for one, other in zip(whole, halves, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)


def test_steps_equal_a_run():
    stepping, running = simulation_of(), list(simulation_of().run(0.05))
    for expected in running[1:]:
        frame = stepping.step()
        assert frame.time == pytest.approx(expected.time)
        np.testing.assert_array_equal(frame.positions, expected.positions)


def test_a_reset_returns_to_a_state_or_to_the_start():
    simulation = simulation_of()
    for _ in range(5):
        simulation.step()
    state, then = simulation.state, simulation.frame
    after = simulation.step()
    simulation.reset(state)
    np.testing.assert_array_equal(simulation.frame.positions, then.positions)
    np.testing.assert_array_equal(simulation.step().positions, after.positions)
    simulation.reset()
    assert simulation.time == 0
    np.testing.assert_array_equal(simulation.frame.positions, simulation.particles.positions)


def test_a_state_of_one_s_own_can_be_set():
    simulation = simulation_of()
    state = simulation.state
    fluid = ParticleState(state.fluid.positions, torch.full_like(state.fluid.velocities, 0.5))
    simulation.reset(type(state)(state.frame, fluid))
    assert simulation.frame.velocities[0].tolist() == [0.5, 0.5, 0.5]


def test_interpolated_frames_of_free_fall_are_exact_and_none_enters_the_solid():
    simulation = simulation_of()
    for frame in simulation.run(0.3, fps=90):
        assert BALL.distance(torch.from_numpy(frame.positions)).min() > CLEARANCE - 1e-4
        if frame.time < 0.05:
            fallen = simulation.particles.positions[:, 2] - frame.positions[:, 2]
            # The solver's steps of 1 ms lag by half a step of velocity, less than 0.3 mm here.
            np.testing.assert_allclose(fallen, 9.81 / 2 * frame.time**2, atol=3e-4)


def test_a_learned_simulator_runs_by_its_name():
    frame = simulation_of(simulator="surfsup").step()
    assert np.isfinite(frame.positions).all()


@pytest.mark.parametrize(("seconds", "fps"), [(0, 24), (-1, 24), (1, 0), (1, -24), (1, 201)])
def test_times_out_of_range_are_refused(seconds, fps):
    with pytest.raises(InputError, match="seconds must be above 0 and fps above 0 and at most 200"):
        simulation_of().run(seconds, fps)


def test_times_that_are_no_numbers_are_refused():
    with pytest.raises(InputError, match="seconds and fps are numbers up to"):
        simulation_of().run(float("inf"), 24)


def test_an_unknown_simulator_is_refused():
    with pytest.raises(InputError, match="there is no"):
        simulation_of(simulator="dfshp")


def test_anything_but_a_state_is_refused_by_a_reset():
    simulation = simulation_of()
    with pytest.raises(InputError, match="reset to its 'state', not to Frame"):
        simulation.reset(simulation.frame)


@pytest.mark.parametrize("factor", [1 / 15, 1 / 3, 2.0, 20 / 3])
def test_similar_scenes_give_the_same_arrays_to_rounding(factor):
    standard = similar_scene(1.0)
    expected = list(Simulation(standard, device="cpu").run())
    # Rounding alone moves particles on a lattice by 0.1 mm in a frame: whether a pressure acts depends on the last bit.
    start = standard.initial_particles(standard.build_surface())
    nudged = replace(start, block_positions=[np.nextafter(block, np.float32(9)) for block in start.block_positions])
    rounded = list(Simulation(standard, device="cpu", particles=nudged).run())
    for frame, one, other in zip(Simulation(similar_scene(factor), device="cpu").run(), expected, rounded, strict=True):
        assert frame.time == pytest.approx(one.time * factor**0.5)
        for values, scale in (("positions", factor), ("velocities", factor**0.5)):
            truth = getattr(one, values)
            rounding = np.abs(getattr(other, values) - truth).mean()
            assert np.abs(getattr(frame, values) / scale - truth).mean() < 2 * rounding + 1e-6


def test_a_scene_four_times_as_large_gives_the_same_arrays_bit_for_bit():
    pairs = zip(*(Simulation(similar_scene(s), device="cpu").run() for s in (1.0, 4.0)), strict=True)
    for expected, frame in pairs:
        np.testing.assert_array_equal(frame.positions, 4 * expected.positions)
        np.testing.assert_array_equal(frame.velocities, 2 * expected.velocities)


def test_the_rate_and_the_duration_of_the_scene_are_those_of_a_run():
    scene = similar_scene(1 / 3, frames=None, duration=0.1, fps=60)
    frames = list(Simulation(scene, device="cpu").run())
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(6) / 60, atol=1e-9)


MOVING = """
container: {{size: [{side}, {side}, {side}]}}
particle_radius: {radius}
surfaces:
  paddle:
    box: {{size: [{length}, {width}, {length}]}}
    at: [0, 0, {height}]
    motion: {{spin: {{axis: [0, 0, 1], rate: {rate}}}}}
fluid: [{{block: {{min: [-{edge}, -{edge}, 0], max: [{edge}, {edge}, {depth}]}}}}]
"""


def stirred(factor):
    """A pool with a turning paddle, all lengths times ``factor``."""
    sizes = dict(side=0.4, length=0.2, width=0.06, height=0.12, edge=0.17, depth=0.17, radius=0.015)
    scaled = {name: factor * value for name, value in sizes.items()}
    return Simulation(Scene.from_yaml(MOVING.format(**scaled, rate=6 / factor**0.5), "stirred"), device="cpu")


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_similar_scenes_with_moving_solids_give_the_same_frames_after_scaling():
    large, small = stirred(1.0), stirred(0.5)
    for _ in range(12):
        one, other = large.step(), small.step()
        np.testing.assert_allclose(2 * other.positions, one.positions, atol=1e-4)
        np.testing.assert_allclose(other.poses["paddle"].rotation, one.poses["paddle"].rotation, atol=1e-9)
    assert other.time == pytest.approx(one.time / 2**0.5)


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_a_frame_between_two_steps_has_the_pose_of_its_time():
    frames = list(stirred(1.0).run(seconds=0.1, fps=60))
    for frame in frames:
        turned = 2 * np.arccos(frame.poses["paddle"].rotation[0])
        assert turned == pytest.approx(6 * frame.time, abs=1e-6)


def test_a_recording_after_steps_begins_at_the_time_of_its_first_frame(tmp_path):
    scene = Scene(fluid=SCENE.fluid)
    simulation = Simulation(scene, device="cpu")
    for _ in range(4):
        simulation.step()
    simulation.record(tmp_path / "late.h5", seconds=0.05)
    with Trajectory(tmp_path / "late.h5") as trajectory:
        assert trajectory.start_time == pytest.approx(4 * FRAME_TIME)
    continued = Simulation(scene.with_changes(restart=tmp_path / "late.h5"), device="cpu")
    assert continued.time == pytest.approx(13 * FRAME_TIME)


def test_another_gravity_acts_from_the_next_step_on_and_stays():
    simulation = simulation_of()
    simulation.set_gravity((1.0, 0.0, 0.0))
    fallen = simulation.step()
    np.testing.assert_allclose(
        fallen.velocities, np.broadcast_to([FRAME_TIME, 0, 0], fallen.velocities.shape), atol=1e-6
    )
    simulation.reset()
    np.testing.assert_array_equal(simulation.step().velocities, fallen.velocities)
    with pytest.raises(InputError, match="gravity is three numbers of m/s²"):
        simulation.set_gravity((0.0, float("nan"), 0.0))


@pytest.mark.skipif(not is_built(), reason="liquids need the C++ code")
def test_another_viscosity_acts_from_the_next_step_on_and_stays():
    fluid = [Block((-0.1, -0.1, 0), (0.1, 0.1, 0.3))]
    expected = last(Simulation(Scene(fluid=fluid, liquid=Liquid(viscosity=0.5), frames=30))).positions
    simulation = Simulation(Scene(fluid=fluid, frames=30))
    thin = last(simulation).positions
    simulation.reset()
    simulation.set_viscosity(0.5)
    np.testing.assert_array_equal(last(simulation).positions, expected)
    assert np.abs(thin - expected).max() > 0.02
    simulation.reset()
    simulation.set_viscosity(None)
    np.testing.assert_array_equal(last(simulation).positions, thin)
    with pytest.raises(InputError, match="greater than or equal to 0"):
        simulation.set_viscosity(-1.0)


def test_a_tap_that_opens_later_gives_what_that_of_the_scene_gives():
    tap = Tap(disc={"radius": 0.05}, at=(0, 0, 1), speed=1.0, start=0.1)
    fluid = [Block((-0.1, -0.1, 0), (0.1, 0.1, 0.3))]
    expected = last(Simulation(Scene(fluid=fluid, taps=[tap], frames=60)))
    simulation = Simulation(Scene(fluid=fluid, frames=60))
    for _ in range(10):
        simulation.step()
    before = simulation.state
    simulation.set_taps([tap])
    while simulation.time < expected.time - 1e-9:
        frame = simulation.step()
    np.testing.assert_array_equal(frame.positions, expected.positions)
    np.testing.assert_array_equal(frame.ids, expected.ids)
    simulation.reset(before)
    assert len(simulation.frame.positions) == len(simulation.particles.positions)

    # Another tap beside it leaves the first as it is.
    simulation.set_taps([Tap(disc={"radius": 0.05}, at=(0.3, 0, 1), speed=1.0), tap])
    while simulation.time < expected.time - 1e-9:
        frame = simulation.step()
    assert len(frame.ids) > len(expected.ids)
    with pytest.raises(InputError, match=r"taps\.0\.carrier: there is no surface 'cup'"):
        simulation.set_taps([Tap(disc={"radius": 0.05}, at=(0, 0, 1), speed=1.0, carrier="cup")])


def test_the_water_of_a_tap_that_is_closed_flows_freely():
    tap = Tap(disc={"radius": 0.05}, at=(0, 0, 1), direction=(1, 0, 0), speed=0.5)
    simulation = Simulation(Scene(taps=[tap], container={"size": (2, 2, 2)}))
    for _ in range(20):
        frame = simulation.step()
    assert np.abs(frame.velocities[-1, 2]) < 1e-6, "guided"
    simulation.set_taps([])
    count = len(frame.ids)
    for _ in range(20):
        frame = simulation.step()
    assert len(frame.ids) == count
    np.testing.assert_allclose(frame.velocities[-1], [0.5, 0, -9.81 * 0.1], atol=0.1)


def last(simulation: Simulation) -> Frame:
    """The last frame of a simulation."""
    *_, frame = simulation.run()
    return frame


def test_a_name_of_a_file_is_no_scene():
    with pytest.raises(InputError, match=r"takes a Scene, not str; Scene\.load reads one"):
        Simulation("scene.yaml")


def test_a_state_prints_as_one_line():
    assert (
        repr(simulation_of().state)
        == f"<SimulationState after 0 steps, {len(simulation_of().frame.positions)} particles>"
    )
