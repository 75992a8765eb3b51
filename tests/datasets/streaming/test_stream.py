import time

import numpy as np
import psutil
import pytest

from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.streaming.stream import stream
from surfsup.errors import InputError, SimulationError
from tests.datasets.conftest import needs_solver

pytestmark = [needs_solver, pytest.mark.usefixtures("tiny_recipes")]


def test_it_goes_on_and_no_scene_comes_twice(tmp_path):
    with stream("tiny", tmp_path / "files", seed=3, workers=2, ahead=3) as coming:
        simulations = [next(coming) for _ in range(7)]
    assert len({simulated.index for simulated in simulations}) == 7
    assert max(simulated.index for simulated in simulations) < 7 + 3
    for simulated in simulations:
        scene = Drawing("tiny", seed=3).scene(simulated.index)
        assert simulated.scene == scene
        assert len(simulated) == scene.frames
        assert simulated.velocities.shape == simulated.positions.shape == (6, 8, 3)
        np.testing.assert_allclose(simulated.positions[0], scene.initial_particles(None).positions, atol=1e-6)
        assert (simulated.velocities[-1, :, 2] < simulated.velocities[0, :, 2]).all()
        positions, velocities = simulated.window(2, 3)
        np.testing.assert_array_equal(positions, simulated.positions[2:5])
        np.testing.assert_array_equal(velocities, simulated.velocities[2:5])
    assert not (tmp_path / "files").exists(), "the recipe has no files"


def test_no_more_are_made_than_were_asked_for_ahead_until_one_is_read(tmp_path):
    with stream("tiny", tmp_path, workers=2, ahead=2) as coming:
        first = {next(coming).index}
        deadline = time.monotonic() + 60
        done = []
        while len(done) < 2 and time.monotonic() < deadline:
            done += coming.ready()
            time.sleep(0.05)
    # One was read, which started one more; whatever was taken later, never more than two were under way.
    indices = first | {simulated.index for simulated in done}
    assert max(indices) <= len(indices)


def test_leaving_stops_the_simulations_that_are_under_way(tmp_path):
    def solvers() -> list[psutil.Process]:
        return psutil.Process().children(recursive=True)

    with pytest.raises(ZeroDivisionError), stream("prim-shapes", tmp_path, frames=10_000, workers=1):
        deadline = time.monotonic() + 60
        while not solvers() and time.monotonic() < deadline:
            time.sleep(0.05)
        assert solvers()
        raise ZeroDivisionError
    assert not solvers()


def test_scenes_that_are_not_physical_are_left_out_and_a_recipe_of_nothing_else_ends_in_an_error(tmp_path):
    with stream("mixed", tmp_path, workers=1, ahead=1) as coming:
        assert all(next(coming).scene.gravity[2] == -9.81 for _ in range(3))
    with stream("heavy", tmp_path, workers=1, ahead=1) as coming, pytest.raises(SimulationError, match="scene 0: 5 in"):
        next(coming)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"recipe": "nothing"}, "there is no recipe 'nothing'"),
        ({"ahead": 0}, "there must be at least 1"),
        ({"workers": 0}, "there must be at least 1"),
    ],
)
def test_what_cannot_be_streamed_is_refused(tmp_path, changes, complaint):
    arguments = {"recipe": "tiny", "folder": tmp_path / "files", **changes}
    with pytest.raises(InputError, match=complaint), stream(**arguments):
        pass
    assert not (tmp_path / "files").exists()
