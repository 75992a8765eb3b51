import numpy as np
import torch

from surfsup.design.plots import parameter_curves, plot_baselines, plot_runs
from surfsup.design.video import cut_open, evenly_spaced_designs
from surfsup.sdf import Sphere, Transformed
from tests.design.test_run import move_water_left
from tests.design.test_task import ball_task, make_run, optimize_run


def test_the_surface_of_a_video_is_cut_open_towards_the_camera():
    from surfsup.viewing.camera import fit_camera

    ball = Transformed(Sphere(0.2), translation=(0.1, 0.0, 0.5))
    camera = fit_camera((1.0, 1.0, 2.0), np.array([[-0.1, -0.2, 0.3], [0.3, 0.2, 0.7]]), None, (320, 240))
    towards = torch.tensor(camera.eye - camera.target, dtype=torch.float32)
    towards = 0.1 * torch.nn.functional.normalize(towards * torch.tensor([1.0, 1.0, 0.0]), dim=0)
    center = torch.tensor([0.1, 0.0, 0.5])
    front_and_back = torch.stack([center + towards, center - towards])
    assert (ball.distance(front_and_back) < 0).all()
    assert (cut_open(ball).distance(front_and_back) < 0).tolist() == [False, True]


def test_plots_show_every_parameter(tmp_path):
    run = optimize_run(make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=1))
    assert list(parameter_curves(run)) == ["x"] and len(parameter_curves(run)["x"]) == 2
    assert plot_runs([run, run], tmp_path / "runs.png").stat().st_size > 10_000
    assert plot_baselines({"a": [0.0, 1.0], "b": [0.5]}, "title", tmp_path / "baselines.png").stat().st_size > 5_000


def test_a_video_shows_designs_where_the_shape_changes(tmp_path):
    run = make_run(ball_task(), tmp_path)
    run.designs = [{"x": torch.tensor(x)} for x in (0.0, 0.1, 0.5, 0.5001, 0.5002, 0.5003, 0.6)]
    run.rewards = [0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0]
    assert evenly_spaced_designs(run) == [0, 1, 2, 6]
