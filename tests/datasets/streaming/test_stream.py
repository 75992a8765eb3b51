import time

import numpy as np
import psutil
import pytest

from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.streaming.stream import open_stream
from surfsup.errors import InputError, SimulationError
from tests.datasets.conftest import needs_solver

pytestmark = [needs_solver, pytest.mark.usefixtures("tiny_recipes")]


def test_the_stream_is_endless_and_no_scene_occurs_twice(tmp_path):
    with open_stream("tiny", tmp_path / "files", seed=3, workers=2, max_pending=3) as stream:
        simulations = [next(stream) for _ in range(7)]
    assert len({simulated.index for simulated in simulations}) == 7
    assert max(simulated.index for simulated in simulations) < 7 + 3
    for simulated in simulations:
        scene = SceneSampler("tiny", seed=3).scene(simulated.index)
        assert simulated.scene == scene
        assert len(simulated) == scene.frames
        assert simulated.velocities.shape == simulated.positions.shape == (6, 8, 3)
        np.testing.assert_allclose(simulated.positions[0], scene.initial_particles(None).positions, atol=1e-6)
        assert (simulated.velocities[-1, :, 2] < simulated.velocities[0, :, 2]).all()
        positions, velocities = simulated.window(2, 3)
        np.testing.assert_array_equal(positions, simulated.positions[2:5])
        np.testing.assert_array_equal(velocities, simulated.velocities[2:5])
    assert not (tmp_path / "files").exists(), "the recipe has no files"


def test_no_more_than_max_pending_simulations_run_or_wait(tmp_path):
    with open_stream("tiny", tmp_path, workers=2, max_pending=2) as stream:
        first = {next(stream).index}
        deadline = time.monotonic() + 60
        done = []
        while len(done) < 2 and time.monotonic() < deadline:
            done += stream.finished()
            time.sleep(0.05)
    # Each simulation that was taken started one more, so that never more than two were pending.
    indices = first | {simulated.index for simulated in done}
    assert max(indices) <= len(indices)


def test_leaving_the_context_stops_the_running_simulations(tmp_path):
    def solvers() -> list[psutil.Process]:
        children = psutil.Process().children(recursive=True)  # also Python's resource tracker
        return [child for child in children if "surfsup.splishsplash.child_process" in child.cmdline()]

    with pytest.raises(ZeroDivisionError), open_stream("prim-shapes", tmp_path, frames=10_000, workers=1):
        deadline = time.monotonic() + 60
        while not solvers() and time.monotonic() < deadline:
            time.sleep(0.05)
        assert solvers()
        raise ZeroDivisionError
    assert not solvers()


def test_unphysical_scenes_are_left_out_and_a_recipe_without_others_is_an_error(tmp_path):
    with open_stream("mixed", tmp_path, workers=1, max_pending=1) as stream:
        assert all(next(stream).scene.gravity[2] == -9.81 for _ in range(3))
    with (
        open_stream("heavy", tmp_path, workers=1, max_pending=1) as stream,
        pytest.raises(SimulationError, match="scene 0: 5 in"),
    ):
        next(stream)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recipe": "nothing"}, "there is no recipe 'nothing'"),
        ({"max_pending": 0}, "must be at least 1"),
        ({"workers": 0}, "must be at least 1"),
    ],
)
def test_invalid_arguments_are_an_error(tmp_path, changes, message):
    arguments = {"recipe": "tiny", "folder": tmp_path / "files", **changes}
    with pytest.raises(InputError, match=message), open_stream(**arguments):
        pass
    assert not (tmp_path / "files").exists()
