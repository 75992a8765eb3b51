import numpy as np
import torch

from surfsup.design.figure import curves, draw_rivals, draw_runs
from surfsup.design.film import along_the_way, opened
from surfsup.sdf import Sphere, Transformed
from tests.design.test_run import away
from tests.design.test_task import ball_task, climb, run_of


def test_the_solid_of_a_film_is_open_towards_the_camera():
    from surfsup.viewing.camera import frame_camera

    ball = Transformed(Sphere(0.2), translation=(0.1, 0.0, 0.5))
    camera = frame_camera((1.0, 1.0, 2.0), np.array([[-0.1, -0.2, 0.3], [0.3, 0.2, 0.7]]), None, (320, 240))
    towards = torch.tensor(camera.eye - camera.target, dtype=torch.float32)
    towards = 0.1 * torch.nn.functional.normalize(towards * torch.tensor([1.0, 1.0, 0.0]), dim=0)
    middle = torch.tensor([0.1, 0.0, 0.5])
    assert (ball.distance(torch.stack([middle + towards, middle - towards])) < 0).all()
    assert (opened(ball).distance(torch.stack([middle + towards, middle - towards])) < 0).tolist() == [False, True]


def test_figures_show_every_parameter(simulator, tmp_path):
    run = climb(run_of(ball_task(height=0.2, reward=away), simulator, tmp_path, iterations=1))
    assert list(curves(run)) == ["x"] and len(curves(run)["x"]) == 2
    assert draw_runs([run, run], tmp_path / "runs.png").stat().st_size > 10_000
    assert draw_rivals({"a": [0.0, 1.0], "b": [0.5]}, "title", tmp_path / "rivals.png").stat().st_size > 5_000


def test_a_film_dwells_where_the_shape_changes(simulator, tmp_path):
    run = run_of(ball_task(), simulator, tmp_path)
    run.designs = [{"x": torch.tensor(x)} for x in (0.0, 0.1, 0.5, 0.5001, 0.5002, 0.5003, 0.6)]
    run.rewards = [0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0]
    assert along_the_way(run) == [0, 1, 2, 6]
