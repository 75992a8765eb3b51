import json

import numpy as np
import pytest
import torch

from surfsup.errors import InputError, Interrupted
from surfsup.io.output_folder import OutputFolder, PenetrationCounter
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.scene.solids import MovingSolid, Solids
from surfsup.sdf import Sphere

SCENE = Scene.from_yaml("frames: 12\nfluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]", "test")
START = SCENE.initial_particles(None)
COUNT = len(START.positions)


def frames(number=12, stop=None):
    for frame in range(number):
        if frame == stop:
            raise KeyboardInterrupt
        yield START.positions + np.float32(0.001 * frame), np.zeros_like(START.positions), {}


def record(folder, source, surface=None):
    reported = []
    summary = folder.record(
        SCENE, Solids(surface), source, Provenance("a test", 7), "cpu", lambda *progress: reported.append(progress)
    )
    return summary, reported


def test_frames_and_summary_and_progress_agree(tmp_path):
    folder = OutputFolder(tmp_path / "new" / "out", COUNT, 12)
    summary, reported = record(folder, frames())
    assert (summary.frames, summary.particles) == (12, COUNT)
    assert reported == [(done, 12) for done in range(1, 13)]
    written = json.loads(folder.summary.read_text())
    assert written["model"] == "a test"
    assert {"seconds", "ms_per_frame", "penetrations", "out_of_container", "device", "version"} <= set(written)
    with Trajectory(folder.trajectory) as trajectory:
        np.testing.assert_array_equal(trajectory.positions[3], START.positions + np.float32(0.003))
        assert trajectory.provenance.seed == 7


def test_particles_in_the_solid_and_out_of_the_container_are_counted(tmp_path):
    def frames_with_penetrations():
        for positions, velocities, poses in frames(3):
            positions = positions.copy()
            positions[0], positions[1] = (0, 0, 0), (0.6, 0, 1)
            yield positions, velocities, poses

    summary, _ = record(OutputFolder(tmp_path, COUNT, 12), frames_with_penetrations(), Sphere(0.1))
    assert (summary.penetrations, summary.out_of_container) == (3, 3)


def test_particles_that_cannot_have_reached_the_solid_are_not_queried_and_the_counts_are_all_the_same():
    queried = []

    class Counted(Sphere):
        def distance(self, points):
            queried.append(len(points))
            return super().distance(points)

        def native_solid(self):
            return None  # C++ would not count

    rng = np.random.default_rng(1)
    positions = rng.uniform(-0.6, 0.6, (500, 3)).astype(np.float32)
    velocities = rng.normal(0, 0.02, positions.shape).astype(np.float32)
    counter, ball = PenetrationCounter(SCENE.container, Solids(Counted(0.2))), Sphere(0.2)
    found = []
    for _ in range(20):
        inside = int((ball.distance(torch.from_numpy(positions)) < 0).sum())
        found.append(counter.count(positions, {})[0])
        assert found[-1] == inside
        positions = positions + velocities
    assert len(set(found)) > 5
    assert queried[0] == 500
    assert sum(queried) < 0.5 * 20 * 500


def test_a_solid_that_moves_onto_resting_particles_contains_them():
    rest = Pose.of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    counter = PenetrationCounter(SCENE.container, Solids(None, (MovingSolid("ball", Sphere(0.1), lambda time: rest),)))
    positions = np.array([[0.0, 0.0, 0.5]], np.float32)
    assert counter.count(positions, {"ball": rest}) == (0, 0)
    assert counter.count(positions, {"ball": Pose.of((0.0, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0))}) == (1, 0)


def test_an_interrupt_keeps_the_finished_frames(tmp_path):
    folder = OutputFolder(tmp_path, COUNT, 12)
    with pytest.raises(
        Interrupted, match=f"5 of 12 frames are kept in {folder.trajectory}; .* surfsup view {tmp_path} shows"
    ):
        record(folder, frames(stop=5))
    with Trajectory(folder.trajectory) as trajectory:
        assert len(trajectory) == 5
    assert json.loads(folder.summary.read_text())["frames"] == 5


def test_an_unusable_folder_is_an_error(tmp_path):
    taken = tmp_path / "file"
    taken.write_text("mine")
    with pytest.raises(InputError, match="cannot be used as the output folder"):
        OutputFolder(taken, COUNT, 12)
    assert taken.read_text() == "mine"


def test_a_trajectory_larger_than_the_disk_is_an_error_before_the_simulation(tmp_path):
    with pytest.raises(InputError, match="MB are free; give fewer --frames"):
        OutputFolder(tmp_path / "new", 1_000_000_000, 1_000_000)
    assert not (tmp_path / "new").exists()


def test_an_unwritable_trajectory_is_an_error_of_one_line(tmp_path):
    folder = OutputFolder(tmp_path / "out", COUNT, 12)
    folder.trajectory.mkdir(parents=True)  # a folder where the file should go
    with pytest.raises(InputError, match="cannot be written"):
        record(folder, frames())
