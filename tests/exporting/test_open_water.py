"""Exports of trajectories in which water enters and leaves."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.exporting.source import FrameSource
from surfsup.scene import Scene

TEXT = """
container: {size: [0.5, 0.5, 0.6]}
taps: [{disc: {radius: 0.05}, at: [0, 0, 0.5], speed: 2}]
drains: [{box: {size: [0.5, 0.5, 0.1]}, at: [0, 0, 0.05]}]
frames: 61
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("open") / "t.h5"
    sf.Simulation(Scene.from_yaml(TEXT, "test")).record(file)
    return file


def test_a_frame_has_the_particles_that_are_in_the_scene_with_their_ids(path):
    with sf.Trajectory(path) as trajectory:
        for number, frame in enumerate(FrameSource(trajectory)):
            np.testing.assert_array_equal(frame.ids, trajectory.ids(number))
            np.testing.assert_array_equal(frame.positions, trajectory.positions[number][frame.ids])
        assert number == 60 and frame.ids[0] > 0  # the first ones have left


@pytest.mark.parametrize("form", ["npz", "ply", "bgeo", "vtk"])
def test_every_frame_is_exported_from_the_empty_one_on(path, tmp_path, form):
    done = sf.export(path, form, tmp_path, fps=60)
    assert done.frames == 19 and len(list(tmp_path.glob(f"particles.*.{form}"))) == 19


def test_frames_between_two_have_finite_particles_with_ascending_ids(path, tmp_path):
    sf.export(path, "npz", tmp_path, fps=97)
    for file in tmp_path.glob("*.npz"):
        with np.load(file) as frame:
            assert np.isfinite(frame["positions"]).all() and (np.diff(frame["ids"]) > 0).all()
            assert len(frame["ids"]) == len(frame["positions"])
