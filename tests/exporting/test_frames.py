"""Frames at any rate."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.exporting.frames import Interpolation, ParticleFrame, frame_count, resample
from surfsup.exporting.source import FrameSource
from surfsup.io.trajectory import Trajectory
from surfsup.scene import PARTICLE_RADIUS
from surfsup.scene.units import Units
from surfsup.sdf import Sphere
from surfsup.simulation import Simulation
from surfsup.sph.collision import CLEARANCE
from surfsup.sph.environment import Environment
from tests.exporting.conftest import SCENE

STEP = 0.005
EMPTY_ROOM = Environment(None, torch.full((3,), -1e6), torch.full((3,), 1e6), torch.zeros(3))


def splines(environment):
    """The interpolation in a scene where nothing moves, with particles of 15 mm."""
    return Interpolation(lambda time: environment, Units(PARTICLE_RADIUS), STEP)


def frames_of(positions, velocities):
    """Frames from positions and velocities (frames, N, 3)."""
    for number, (x, v) in enumerate(zip(positions, velocities, strict=True)):
        yield ParticleFrame(
            number * STEP, x.astype(np.float32), v.astype(np.float32), np.arange(len(x), dtype=np.int32), 0.015
        )


@pytest.mark.parametrize(
    ("frames", "fps", "expected"),
    [(800, 200, 800), (800, 24, 96), (800, 25, 100), (800, 30, 120), (801, 60, 241), (1, 24, 1), (0, 24, 0)],
)
def test_frames_are_counted_up_to_the_last_frame_of_the_trajectory(frames, fps, expected):
    assert frame_count(frames, STEP, fps) == expected
    still = np.zeros((frames, 1, 3))
    made = list(resample(frames_of(still, still), STEP, fps, splines(EMPTY_ROOM)))
    assert len(made) == expected
    np.testing.assert_allclose([frame.time for frame in made], np.arange(expected) / fps, atol=1e-12)


def test_at_the_rate_of_the_trajectory_frames_are_those_of_the_file(trajectory):
    with Trajectory(trajectory) as file:
        frames = list(resample(FrameSource(file), file.frame_time, 200, splines(EMPTY_ROOM)))
        np.testing.assert_array_equal([frame.positions for frame in frames], file.positions[:])
        np.testing.assert_array_equal([frame.velocities for frame in frames], file.velocities[:])


def test_frames_between_are_those_of_a_simulation_at_that_rate(trajectory):
    simulation = Simulation(SCENE, device="cpu")
    environment = Environment.of(SCENE, SCENE.build_surface())
    with Trajectory(trajectory) as file:
        made = list(resample(FrameSource(file), file.frame_time, 24, splines(environment)))
    for frame, expected in zip(made, simulation.run(0.3, fps=24), strict=False):
        assert frame.time == pytest.approx(expected.time)
        np.testing.assert_allclose(frame.positions, expected.positions, atol=1e-6)
        np.testing.assert_allclose(frame.velocities, expected.velocities, atol=1e-3)  # the file rounds velocities


@settings(max_examples=40)
@given(st.floats(1, 1000), st.integers(1, 30), st.integers(0, 1000))
def test_motion_that_is_cubic_in_time_is_exact_at_any_rate(fps, frames, seed):
    coefficients = np.random.default_rng(seed).normal(size=(4, 3, 3))  # of 1, t, t², t³ with t in frames
    times = np.arange(frames)

    def motion(t):
        powers = np.stack([np.ones_like(t), t, t**2, t**3], axis=1)
        slopes = np.stack([np.zeros_like(t), np.ones_like(t), 2 * t, 3 * t**2], axis=1)
        return np.einsum("fk,knd->fnd", powers, coefficients), np.einsum("fk,knd->fnd", slopes, coefficients) / STEP

    made = list(resample(frames_of(*motion(1.0 * times)), STEP, fps, splines(EMPTY_ROOM)))
    positions, velocities = motion(np.arange(len(made)) / (fps * STEP))
    scale = 1 + frames**3
    np.testing.assert_allclose([frame.positions for frame in made], positions, atol=1e-5 * scale)
    np.testing.assert_allclose([frame.velocities for frame in made], velocities, atol=1e-5 * scale / STEP)


def test_particles_that_are_in_one_frame_alone_are_not_between():
    old, new = frames_of(np.zeros((2, 3, 3)), np.zeros((2, 3, 3)))
    old, new = replace(old, ids=np.int32([1, 4, 6])), replace(new, ids=np.int32([4, 6, 9]))
    new.positions[:] = [[1, 0, 0], [2, 0, 0], [3, 0, 0]]
    between = splines(EMPTY_ROOM)(old, new, 0.0025)
    assert between.ids.tolist() == [4, 6]
    np.testing.assert_allclose(between.positions, [[0.5, 0, 0], [1, 0, 0]])


def test_the_number_of_particles_may_change_from_frame_to_frame():
    frames = [cut for frame, count in zip(frames_of(*np.zeros((2, 4, 5, 3))), (2, 5, 5, 0), strict=True)
              for cut in [replace(frame, positions=frame.positions[:count], velocities=frame.velocities[:count],
                                  ids=frame.ids[:count])]]  # fmt: skip
    made = list(resample(frames, STEP, 400, splines(EMPTY_ROOM)))
    assert [len(frame.positions) for frame in made] == [2, 2, 5, 5, 5, 0, 0]


def test_a_spline_that_enters_the_solid_is_moved_out():
    ball = Environment(Sphere(0.3), *torch.tensor([[-1.0] * 3, [1.0] * 3]), torch.zeros(3))
    angle = 0.2
    ends = 0.321 * np.array([[np.cos(-angle), np.sin(-angle), 0], [np.cos(angle), np.sin(angle), 0]])
    old, new = frames_of(ends[:, None], np.zeros((2, 1, 3)))
    halfway = splines(ball)(old, new, STEP / 2)
    assert np.linalg.norm(halfway.positions) == pytest.approx(0.3 + CLEARANCE, abs=1e-5)


def test_particles_that_the_trajectory_has_in_the_solid_stay_there():
    ball = Environment(Sphere(0.3), *torch.tensor([[-1.0] * 3, [1.0] * 3]), torch.zeros(3))
    old, new = frames_of(np.array([[[0.1, 0, 0]], [[0.2, 0, 0]]]), np.zeros((2, 1, 3)))
    halfway = splines(ball)(old, new, STEP / 2)
    np.testing.assert_allclose(halfway.positions, [[0.15, 0, 0]], atol=1e-7)
