import itertools
import math

import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup.evaluation.metrics import kd_tree, max_density
from surfsup.native.dispatch import is_built
from surfsup.scene import SPACING, Scene, Units
from surfsup.sph.drains import DrainRegion
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.taps import CarrierMotion

needs_native = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
FREE = "container: none\ngravity: [0, 0, 0]\n"
JET = "taps: [{disc: {radius: 0.08}, at: [0, 0, 1], direction: [1, 0, 0], speed: %g}]\n"
STILL = CarrierMotion({}, {}, 0.005)


def scene_of(text):
    return Scene.from_yaml(text, "test")


def frames_of(text, seconds, fps=None):
    return list(sf.Simulation(scene_of(text)).run(seconds, fps))


class TestTaps:
    @pytest.mark.parametrize("speed", [0.4, 1.7, 9.0])
    def test_a_jet_without_gravity_keeps_its_speed_and_its_density(self, speed):
        frame = frames_of(FREE + JET % speed, 0.5 / speed + 0.1)[-1]
        np.testing.assert_allclose(frame.velocities[:, 0], speed, rtol=1e-4)
        assert np.abs(frame.velocities[:, 1:]).max() < 1e-4 * speed
        assert 0.95 < max_density(kd_tree(frame.positions)) < 1.03

    def test_water_under_pressure_at_the_nozzle_does_not_burst(self):
        # The water of a fountain falls back onto its own nozzle.
        text = "container: none\ntaps: [{disc: {radius: 0.08}, at: [0, 0, 0], direction: [0, 0, 1], speed: 2}]\n"
        for frame in frames_of(text, 0.7)[::10]:
            if len(frame.ids) > 10:
                assert max_density(kd_tree(frame.positions)) < 1.03
                assert frame.velocities[:, 2].max() < 2.0 + 0.4

    @needs_native
    @pytest.mark.parametrize(
        "tap",
        [
            "at: [0, 0, 0.02], direction: [0, 0, 1], speed: 2",  # in the floor
            "at: [-0.18, 0, 0.1], direction: [1, 0, 0], speed: 1",  # in a wall
            "at: [0, 0, 0.12], direction: [1, 0, 0], speed: 1",  # in the middle of the water
        ],
    )
    def test_a_tap_under_water_pushes_it_aside(self, tap):
        text = (
            "container: {size: [0.4, 0.4, 0.8]}\n"
            "fluid: [{block: {min: [-0.19, -0.19, 0.01], max: [0.19, 0.19, 0.2]}}]\n"
            f"taps: [{{disc: {{radius: 0.06}}, {tap}, from: 0.05}}]"
        )
        frames = frames_of(text, 0.4)
        # The layer that comes first compresses the water for a frame.
        assert np.mean([max_density(kd_tree(frame.positions)) < 1.1 for frame in frames[16::2]]) > 0.85
        assert frames[-1].positions[:, 2].mean() > frames[9].positions[:, 2].mean()

    def test_a_falling_jet_gains_the_speed_of_its_fall(self):
        frame = frames_of("container: none\ntaps: [{disc: {radius: 0.08}, at: [0, 0, 1], speed: 4}]\n", 0.3)[-1]
        depth = 1 - frame.positions[:, 2]
        free = depth > 2 * SPACING
        expected = np.sqrt(16 + 2 * 9.81 * (depth[free] - 2 * SPACING))
        np.testing.assert_allclose(-frame.velocities[free, 2], expected, rtol=0.03)

    @pytest.mark.parametrize("flow", [0.8, 13.0])
    @pytest.mark.parametrize("fps", [None, 60])
    def test_the_liters_after_a_time_are_those_of_the_flow(self, flow, fps):
        text = f"container: none\ntaps: [{{disc: {{radius: 0.06}}, at: [0, 0, 1], flow: {flow}, from: 0.1}}]\n"
        scene = scene_of(text)
        layer = len(scene.taps[0].nozzle(SPACING).points) * SPACING**3 * 1000
        for frame in frames_of(text, 0.6, fps):
            liters = len(frame.ids) * SPACING**3 * 1000
            assert abs(liters - flow * max(0.0, frame.time - 0.1)) <= 0.5 * layer + 1e-6

    def test_a_layer_enters_at_its_own_time_within_a_frame(self):
        frame = frames_of(FREE + JET % 2.0, 0.055)[-1]
        passed = scene_of(FREE + JET % 2.0).taps[0].nozzle(SPACING).layer_times(0.0, frame.time)
        np.testing.assert_allclose(
            np.unique(frame.positions[:, 0].round(5)), 2 * (frame.time - passed)[::-1], atol=2e-5
        )

    def test_a_tap_that_closes_gives_no_more(self):
        text = FREE + JET.replace("speed", "until: 0.1, speed") % 2.0
        counts = [len(frame.ids) for frame in frames_of(text, 0.3)]
        assert counts[-1] == counts[21] > counts[10]

    @needs_native
    def test_a_tap_on_a_solid_that_moves_adds_its_velocity(self):
        text = FREE + (
            "surfaces: {arm: {box: {size: [0.05, 0.05, 0.05]}, motion: {between: linear, keyframes: "
            "[{time: 0, position: [0, 0, 1]}, {time: 10, position: [0, 15, 1]}]}}}\n"
            "taps: [{disc: {radius: 0.05}, at: [0.1, 0, 0], direction: [1, 0, 0], speed: 2, carrier: arm}]"
        )
        frame = frames_of(text, 0.2)[-1]
        np.testing.assert_allclose(frame.velocities, np.broadcast_to([2, 1.5, 0], frame.velocities.shape), atol=1e-3)

    def test_a_larger_scene_with_larger_particles_gives_the_same_arrays(self):
        small = frames_of("container: none\n" + JET % 2.0, 0.2)[-1]
        text = (
            "container: none\nparticle_radius: 0.06\n"
            "taps: [{disc: {radius: 0.32}, at: [0, 0, 4], speed: 4, direction: [1, 0, 0]}]"
        )
        large = frames_of(text, 0.4)[-1]
        np.testing.assert_allclose(large.positions, Units(0.06).length * small.positions, atol=1e-5)
        np.testing.assert_allclose(large.velocities, Units(0.06).velocity * small.velocities, atol=1e-5)

    @needs_native
    def test_the_engine_in_warp_gives_the_same_as_the_one_in_c(self):
        text = "container: {size: [0.4, 0.4, 0.6]}\n" + JET.replace("[0, 0, 1]", "[-0.1, 0, 0.3]") % 2.0
        solver = DfsphSolver()
        solver.native = None
        one, other = sf.Simulation(scene_of(text)), sf.Simulation(scene_of(text), solver, device="cpu")
        for _ in range(20):
            here, there = one.step(), other.step()
        np.testing.assert_array_equal(here.ids, there.ids)
        np.testing.assert_allclose(here.positions, there.positions, atol=2e-5)


class TestDrains:
    REGION = DrainRegion(sf.Sphere(0.1), 0.0, math.inf)

    def takes(self, before, after, region=REGION, motion=STILL):
        return region.takes(np.array([before]), np.array([after]), 0.005, motion)[0]

    def test_a_particle_is_taken_where_its_way_enters_the_region(self):
        assert self.takes((0.2, 0, 0), (0.05, 0, 0))
        assert self.takes((0.2, 0, 0), (-0.2, 0, 0))  # right through it
        assert not self.takes((0.2, 0, 0), (0.11, 0, 0))
        assert not self.takes((0.2, 0.15, 0), (-0.2, 0.15, 0))

    def test_a_closed_drain_takes_nothing(self):
        closed = DrainRegion(sf.Sphere(0.1), 0.01, math.inf), DrainRegion(sf.Sphere(0.1), -1.0, 0.0)
        assert not any(self.takes((0, 0, 0), (0, 0, 0), region) for region in closed)

    def test_a_drain_on_a_solid_is_where_the_solid_is(self):
        region = DrainRegion(sf.Sphere(0.1), 0.0, math.inf, "arm")
        motion = CarrierMotion({"arm": sf.Pose.of((1, 0, 0))}, {"arm": sf.Pose.of((1.2, 0, 0))}, 0.005)
        assert self.takes((1.25, 0, 0), (1.25, 0, 0), region, motion)
        assert not self.takes((0, 0, 0), (0, 0, 0), region, motion)

    def test_water_leaves_and_the_rest_keeps_its_ids(self):
        text = (
            "container: {size: [0.4, 0.4, 1]}\nfluid: [{block: {min: [-0.15, -0.15, 0.2], max: [0.15, 0.15, 0.5]}}]\n"
            "drains: [{box: {size: [0.1, 0.1, 0.1]}, from: 0.4}]"
        )
        frames = frames_of(text, 1.0)
        before, after = frames[80], frames[-1]
        np.testing.assert_array_equal(before.ids, np.arange(len(frames[0].ids)))
        assert 0 < len(after.ids) < len(before.ids)
        assert (np.diff(after.ids) > 0).all() and np.isin(after.ids, before.ids).all()
        for one, other in itertools.pairwise(frames[80:]):
            _, here, there = np.intersect1d(one.ids, other.ids, return_indices=True)
            steps = np.linalg.norm(other.positions[there] - one.positions[here], axis=1)
            assert steps.max() < 0.04  # an id that named another particle would jump

    def test_all_water_may_leave(self):
        text = (
            "container: none\nfluid: [{block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.4]}}]\n"
            "drains: [{box: {size: [2, 2, 0.1]}}]"
        )
        last = frames_of(text, 0.5)[-1]
        assert len(last.ids) == 0 and last.positions.shape == (0, 3)


class TestRecycling:
    TEXT = (
        "container: {size: [0.4, 0.4, 1]}\nfluid: [{block: {min: [-0.15, -0.15, 0.05], max: [0.15, 0.15, 0.25]}}]\n"
        "drains: [{box: {size: [0.4, 0.4, 0.08]}}]\n"
        "taps: [{rectangle: {size: [0.06, 0.06]}, at: [0, 0, 0.8], speed: 1, recycle: true}]"
    )

    def test_a_tap_that_recycles_gives_what_drains_have_taken(self):
        simulation = sf.Simulation(scene_of(self.TEXT))
        count = len(simulation.frame.ids)
        for _ in range(100):
            frame = simulation.step()
            assert len(frame.ids) + simulation.state.fluid.drained == count
        assert simulation.state.fluid.next_id > count


class TestSimulation:
    TEXT = "container: {size: [0.5, 0.5, 1]}\n" + JET.replace("[0, 0, 1]", "[-0.2, 0, 0.5]") % 1.5

    def test_reset_returns_to_the_particles_of_then(self):
        simulation = sf.Simulation(scene_of(self.TEXT))
        for _ in range(30):
            simulation.step()
        state = simulation.state
        ahead = [simulation.step() for _ in range(20)][-1]
        simulation.reset(state)
        again = [simulation.step() for _ in range(20)][-1]
        np.testing.assert_array_equal(ahead.ids, again.ids)
        np.testing.assert_array_equal(ahead.positions, again.positions)

    def test_a_scene_that_neither_gives_nor_takes_is_bit_for_bit_the_scene_without(self):
        block = "fluid: [{block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.5]}}]\n"
        closed = (
            block + "drains: [{sphere: {radius: 0.1}, at: [0, 0, 1.8]}]\n" + JET.replace("speed", "from: 9, speed") % 1
        )
        for here, there in zip(frames_of(block, 0.3), frames_of(closed, 0.3), strict=True):
            np.testing.assert_array_equal(here.positions, there.positions)
            np.testing.assert_array_equal(here.velocities, there.velocities)

    def test_a_frame_between_two_steps_has_the_particles_of_its_time(self):
        whole = {round(frame.time, 9): len(frame.ids) for frame in frames_of(self.TEXT, 0.2)}
        for frame in frames_of(self.TEXT, 0.2, fps=150):
            lower = whole[round(math.floor(frame.time * 200 + 1e-6) / 200, 9)]
            upper = whole.get(round(math.ceil(frame.time * 200 - 1e-6) / 200, 9), lower + 100)
            assert lower <= len(frame.ids) <= upper
            assert np.isfinite(frame.positions).all() and len(frame.positions) == len(frame.ids)

    def test_a_continued_scene_recognizes_the_layers_that_its_taps_guide(self, tmp_path):
        scene = scene_of(self.TEXT)
        whole = sf.Simulation(scene)
        whole.record(tmp_path / "first.h5", seconds=0.305)
        half = sf.Simulation(scene.with_changes(restart=tmp_path / "first.h5"))
        assert half.time == pytest.approx(0.3)
        # The last frame of the file is the one before the state at its end.
        assert len(half.frame.ids) == len(sf.Trajectory(tmp_path / "first.h5").ids(60))
        assert len(half.state.fluid.layers) > 0
        half.step()
        for _ in range(20):
            here, there = whole.step(), half.step()
        assert len(here.ids) == len(there.ids)
        np.testing.assert_allclose(here.positions, there.positions, atol=2e-4)

    def test_tensors_of_the_state_have_the_same_rows_as_ids(self):
        simulation = sf.Simulation(scene_of(self.TEXT))
        for _ in range(10):
            simulation.step()
        fluid = simulation.state.fluid
        assert len(fluid.ids) == len(fluid.positions) == len(fluid.velocities) == fluid.next_id
        assert isinstance(fluid.positions, torch.Tensor) and fluid.positions.dtype == torch.float32
