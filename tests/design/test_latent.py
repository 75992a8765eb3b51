from pathlib import Path

import pytest
import torch

from surfsup.design.folder import resume
from surfsup.design.paper.latent import latent
from surfsup.design.task import Task
from surfsup.errors import InputError
from surfsup.sdf.neural.deepsdf import DeepSdf, save_deepsdf
from surfsup.sdf.neural.deepsdf_decoder import DecoderSizes, DeepSdfDecoder
from tests.design.test_task import make_run, optimize_run

RADII = (0.4, 0.5, 0.6, 0.7)  # of balls; the first element of a code determines the radius


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Path:
    """A DeepSDF of balls, accurate enough for collisions."""
    torch.manual_seed(0)
    codes = torch.stack([torch.tensor([(radius - 0.55) / 0.1, 0.1 * radius]) for radius in RADII])
    network = DeepSdfDecoder(DecoderSizes(width=24, layers=3, code=2, octaves=0))
    adam = torch.optim.Adam(network.parameters(), lr=5e-3)
    for _ in range(200):
        points = 1.6 * torch.rand(len(RADII), 300, 3) - 0.8
        target = points.norm(dim=-1) - torch.tensor(RADII)[:, None]
        adam.zero_grad()
        (network.value(points, codes) - target).abs().mean().backward()
        adam.step()
    path = tmp_path_factory.mktemp("deepsdf") / "balls.safetensors"
    save_deepsdf(path, DeepSdf(network, codes, [f"ball-{radius}" for radius in RADII]))
    return path


@pytest.fixture
def task(balls, monkeypatch) -> Task:
    monkeypatch.setattr("surfsup.sdf.neural.surface.GRID_RESOLUTION", 24)
    monkeypatch.setattr("surfsup.design.paper.latent.WATER", (0.18, 0.09))
    return latent(balls, "ball-0.7", frames=16)


def test_the_gradient_in_the_code_is_close_to_finite_differences(task, simulator):
    start = task.initial_state()
    values = {name: torch.as_tensor(one.start).clone().requires_grad_() for name, one in task.parameters.items()}
    reward = task.score(task.simulate(simulator, values, start))
    (gradient,) = torch.autograd.grad(reward, values["code"])
    ends = []
    for step in (0.05, -0.05):
        moved = {"code": values["code"].detach() + torch.tensor([step, 0.0])}
        with torch.no_grad():
            ends.append(float(task.score(task.simulate(simulator, moved, start))))
    # Only close: the grid differs on both sides, and the reward becomes rough as the water splashes.
    assert float(gradient[0]) == pytest.approx((ends[0] - ends[1]) / 0.1, rel=0.1)


def test_the_code_improves_and_the_run_can_be_resumed(task, tmp_path):
    run = optimize_run(make_run(task, tmp_path, iterations=2))
    assert run.rewards[run.best] > run.rewards[0]
    again = make_run(task, tmp_path, iterations=2)
    resume(again)
    assert again.rewards == run.rewards and torch.equal(again.designs[-1]["code"], run.designs[-1]["code"])


def test_the_prior_prefers_codes_near_the_mean(task):
    from surfsup.design.reward import Outcome

    water = (torch.zeros(1, 3), torch.zeros(1, dtype=torch.bool))
    start = torch.as_tensor(task.parameters["code"].start)
    near, far = (task.reward(Outcome(*water, {"code": start * scale})) for scale in (1, 3))
    assert near > far


def test_an_unknown_shape_is_refused_in_one_line(balls):
    with pytest.raises(InputError, match="has no shape 'chair'; did you mean 'ball-"):
        latent(balls, "chair")
    with pytest.raises(InputError, match="holds 4 shapes; choose one by its name"):
        latent(balls)
