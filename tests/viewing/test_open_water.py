"""Pages and cameras of trajectories in which water enters and leaves."""

import numpy as np

import surfsup as sf
from surfsup.scene import Scene
from surfsup.viewing.trajectory_page import points_of_interest, write_trajectory_page
from surfsup.viewing.web_player import write_web_player
from tests.viewing.test_web_player import contents

TEXT = """
container: {size: [0.5, 0.5, 0.6]}
taps: [{disc: {radius: 0.05}, at: [0, 0, 0.5], speed: 2}]
frames: 21
"""


def grid_of(header, body):
    shape = (header["frames"], header["particles"], 3)
    differences = np.frombuffer(body[-2 * int(np.prod(shape)) :], "<u2").reshape(shape)
    return np.cumsum(differences, axis=0, dtype=np.uint16)


def test_a_particle_that_is_not_in_the_scene_has_the_value_that_the_page_does_not_draw(tmp_path):
    positions = np.random.default_rng(0).uniform(0, 1, (6, 40, 3)).astype(np.float32)
    positions[0, 0] = 1.0  # a particle in the corner is drawn
    positions[:3, 20:] = np.nan
    write_web_player(tmp_path / "p.html", positions, None, (1, 1, 2), 0.015)
    header, body = contents((tmp_path / "p.html").read_text())
    hidden = (grid_of(header, body) == 65535).all(axis=2)
    np.testing.assert_array_equal(hidden, np.isnan(positions).any(axis=2))


def test_the_page_of_a_scene_that_begins_empty_is_written(tmp_path):
    sf.Simulation(Scene.from_yaml(TEXT, "test")).record(tmp_path / "t.h5")
    write_trajectory_page(tmp_path / "t.h5", tmp_path / "p.html", lambda done, total: None)
    header, body = contents((tmp_path / "p.html").read_text())
    hidden = (grid_of(header, body) == 65535).all(axis=2)
    assert hidden[0].all() and not hidden[-1].any()
    assert np.isfinite(header["eye"]).all()
    with sf.Trajectory(tmp_path / "t.h5") as trajectory:
        np.testing.assert_allclose(points_of_interest(trajectory), [[0, 0, 0.5]])
