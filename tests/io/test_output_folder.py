import json

import numpy as np
import pytest

from surfsup.errors import InputError, Interrupted
from surfsup.io.output_folder import OutputFolder
from surfsup.io.trajectory import Provenance, Trajectory
from surfsup.scene import Scene
from surfsup.scene.solids import Solids
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


def test_an_interrupt_keeps_the_finished_frames(tmp_path):
    folder = OutputFolder(tmp_path, COUNT, 12)
    with pytest.raises(Interrupted, match=f"5 of 12 frames are kept in {folder.trajectory}"):
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
