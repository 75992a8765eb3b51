import numpy as np
import pytest
import torch

from surfsup.design import funnel, verify
from surfsup.design.rollout import all_frames
from surfsup.design.verification import final_positions
from surfsup.io.trajectory import Trajectory
from surfsup.sph.environment import Environment
from tests.design.test_run import move_water_left
from tests.design.test_task import ball_task, make_run, optimize_run


def test_a_landed_particle_keeps_its_landing_position():
    path = [[0.0, 0.3], [0.02, 0.1], [0.04, 0.02], [0.5, 0.4]]
    frames = [np.array([[x, 0.0, z], [1.0, 1.0, 1.0]], np.float32) for x, z in path]
    positions, landed = final_positions(frames, 0.06)
    assert landed.tolist() == [True, False]
    assert positions.numpy() == pytest.approx(np.array([[0.03, 0.0, 0.06], [1.0, 1.0, 1.0]]), abs=1e-6)


def test_without_a_floor_the_last_frame_counts():
    frames = [np.full((1, 3), value, np.float32) for value in (0.5, 0.01)]
    positions, landed = final_positions(frames, None)
    assert not landed.any() and positions.tolist() == [[pytest.approx(0.01)] * 3]


def test_landing_positions_equal_those_of_the_rollout(simulator):
    task = funnel(frames=40)
    start, values = task.initial_state(), {"r1": torch.tensor(0.15), "r2": torch.tensor(0.1)}
    environment = Environment.of(task.scene, task.surface(values, start))
    frames = list(all_frames(simulator, environment, start, 40, task.floor))
    positions, landed = final_positions((frame.positions.numpy() for frame in frames), task.floor)
    # In single precision a landed particle may be one digit below the floor, which counts as landed, too.
    assert torch.equal(landed, frames[-1].landed) and torch.allclose(positions, frames[-1].positions, atol=1e-5)


def test_the_reference_solver_decides(tmp_path, monkeypatch):
    monkeypatch.setattr("surfsup.design.shape_files.RESOLUTION", 32)
    run = optimize_run(make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=2))
    verification = verify(run)
    assert verification.passed == (verification.best.reference > verification.first.reference)
    assert ("passed" if verification.passed else "FAILED") in verification.text()
    assert verification.best.dfsph == pytest.approx(run.rewards[run.best], abs=1e-5)
    with Trajectory(tmp_path / "best" / "reference.h5") as frames:
        assert len(frames) == 7
        assert frames.scene.build_surface() is not None
