from pathlib import Path

import pytest
import torch

from surfsup.design.folder import resume
from surfsup.design.paper.latent import latent
from surfsup.design.task import Task
from surfsup.errors import InputError
from surfsup.sdf.neural.code_network import CodeNetwork, CodeSizes
from surfsup.sdf.neural.deepsdf import DeepSdf, save_deepsdf
from tests.design.test_task import climb, run_of

RADII = (0.4, 0.5, 0.6, 0.7)  # of balls; the code's first number says which


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Path:
    """A DeepSDF of balls, fitted well enough for a sphere of particles to meet it."""
    torch.manual_seed(0)
    codes = torch.stack([torch.tensor([(radius - 0.55) / 0.1, 0.1 * radius]) for radius in RADII])
    network = CodeNetwork(CodeSizes(width=24, layers=3, code=2, octaves=0))
    adam = torch.optim.Adam(network.parameters(), lr=5e-3)
    for _ in range(200):
        points = 1.6 * torch.rand(len(RADII), 300, 3) - 0.8
        truth = points.norm(dim=-1) - torch.tensor(RADII)[:, None]
        adam.zero_grad()
        (network.value(points, codes) - truth).abs().mean().backward()
        adam.step()
    path = tmp_path_factory.mktemp("deepsdf") / "balls.safetensors"
    save_deepsdf(path, DeepSdf(network, codes, [f"ball-{radius}" for radius in RADII]))
    return path


@pytest.fixture
def task(balls, monkeypatch) -> Task:
    monkeypatch.setattr("surfsup.sdf.neural.surface.LATTICE_RESOLUTION", 24)
    monkeypatch.setattr("surfsup.design.paper.latent.WATER", (0.18, 0.09))
    return latent(balls, "ball-0.7", frames=16)


def test_gradients_flow_into_the_code(task, simulator):
    values = {name: torch.as_tensor(one.start).clone().requires_grad_() for name, one in task.parameters.items()}
    reward = task.score(task.simulate(simulator, values, task.water()))
    (gradient,) = torch.autograd.grad(reward, values["code"])
    ends = []
    for step in (0.05, -0.05):
        moved = {"code": values["code"].detach() + torch.tensor([step, 0.0])}
        with torch.no_grad():
            ends.append(float(task.score(task.simulate(simulator, moved, task.water()))))
    # The lattice is of another code on either side; and as water splashes a gradient says less and less of a slope.
    assert float(gradient[0]) == pytest.approx((ends[0] - ends[1]) / 0.1, rel=0.1)


def test_the_code_climbs_and_can_be_resumed(task, simulator, tmp_path):
    run = climb(run_of(task, simulator, tmp_path, iterations=2))
    assert run.rewards[run.best] > run.rewards[0]
    again = run_of(task, simulator, tmp_path, iterations=2)
    resume(again)
    assert again.rewards == run.rewards and torch.equal(again.designs[-1]["code"], run.designs[-1]["code"])


def test_a_code_far_from_all_others_is_not_plausible(task):
    from surfsup.design.reward import Outcome

    outcome = (torch.zeros(1, 3), torch.zeros(1, dtype=torch.bool))
    start = torch.as_tensor(task.parameters["code"].start)
    near, far = (task.reward(Outcome(*outcome, {"code": start * scale})) for scale in (1, 3))
    assert near > far


def test_a_shape_that_is_not_there_is_told_in_one_line(balls):
    with pytest.raises(InputError, match="has no shape 'chair'; did you mean 'ball-"):
        latent(balls, "chair")
    with pytest.raises(InputError, match="holds 4 shapes; choose one by its name"):
        latent(balls)
