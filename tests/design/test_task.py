from dataclasses import replace

import pytest
import torch

from surfsup.design import Outcome, Parameter, Task, bowl, funnel, near
from surfsup.design.folder import resume
from surfsup.design.optimize import run_to_end
from surfsup.design.parameter import clamp_to_bounds, start_values
from surfsup.design.run import DesignRun
from surfsup.design.task_options import tasks_from_options
from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.sdf import Sphere, Transformed

SCENE = Scene.from_yaml("fluid: [{block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.4]}}]\nframes: 7", "scene")


def ball_task(height=0.15, **changes) -> Task:
    task = Task(
        "ball",
        lambda x: Transformed(Sphere(0.1), translation=torch.stack([x, torch.zeros(()), torch.tensor(height)])),
        {"x": Parameter(0.01, -1.0, 1.0, 0.01)},
        SCENE,
        near((0.0, 0.0, 0.0), 1.0),
    )
    return replace(task, **changes)


def make_run(task, folder, **options) -> DesignRun:
    folder.mkdir(exist_ok=True)
    return DesignRun(task, folder, **options)


def optimize_run(run: DesignRun, evaluations: int = 10**9) -> DesignRun:
    run_to_end(run, lambda: len(run.rewards) >= evaluations, lambda progress: None)
    return run


class TestPaperTasks:
    @pytest.mark.parametrize(("task", "radii"), [(bowl(), (0.07, 0.05)), (funnel(), (0.10, 0.09))])
    def test_start_as_in_the_paper(self, task, radii):
        assert [float(value) for value in start_values(task.parameters).values()] == pytest.approx(radii)

    @pytest.mark.parametrize("make", [bowl, funnel])
    def test_fit_the_scene_within_all_bounds(self, make):
        task = make()
        start, r1 = task.initial_state(), task.parameters["r1"]
        for capture in (r1.lower, r1.upper):
            for hole in (0.0, 1.0):
                values = {"r1": torch.tensor(capture), "r2": torch.tensor(hole)}
                task.surface(clamp_to_bounds(task.parameters, values), start)

    def test_simulate_the_given_number_of_frames_after_the_first(self):
        assert bowl().scene.frames == 51 and funnel().scene.frames == 76 and bowl(frames=9).scene.frames == 10


class TestBadInputIsRefusedInOneLine:
    def error_of(self, call) -> str:
        with pytest.raises(InputError) as caught:
            call()
        assert "\n" not in str(caught.value)
        return str(caught.value)

    @pytest.mark.parametrize(
        ("task", "message"),
        [
            (lambda: bowl(0.5, 0.05), "the start of r1 is 0.5, outside its bounds: 0.06 to 0.3"),
            (lambda: bowl(0.1, 0.09), "the start of r2 is 0.09, outside its bounds: 0 to 0.08"),
            (lambda: bowl(0.1, -0.01), "the start of r2 is -0.01"),
            (lambda: bowl(float("nan"), 0.05), "the start of r1 is nan"),
            (lambda: funnel(0.2, 0.03), "the start of r2 is 0.03, outside its bounds: 0.065 to 0.19"),
        ],
    )
    def test_a_start_outside_its_bounds(self, tmp_path, task, message):
        assert message in self.error_of(lambda: make_run(task(), tmp_path))

    @pytest.mark.parametrize("value", ["nan", "inf"])
    def test_a_reward_that_is_not_finite(self, tmp_path, value):
        task = ball_task(reward=lambda end: end.positions.sum() * float(value))
        assert f"the reward is {value} at x 0.01" in self.error_of(lambda: optimize_run(make_run(task, tmp_path)))

    @pytest.mark.parametrize("reward", [lambda end: 3.0, lambda end: end.positions[:, 0]])
    def test_a_reward_that_is_not_a_scalar_tensor(self, tmp_path, reward):
        task = ball_task(reward=reward)
        assert "must be one number" in self.error_of(lambda: optimize_run(make_run(task, tmp_path)))

    @pytest.mark.parametrize(
        "changes",
        [
            {"reward": lambda end: end.positions.detach().sum()},
            {"shape": lambda x: Transformed(Sphere(0.1), translation=(0.0, 0.0, 0.15))},
            {"scene": SCENE.with_frames(2), "height": 0.12},
        ],
    )
    def test_a_reward_that_does_not_depend_on_the_shape(self, tmp_path, changes):
        error = self.error_of(lambda: optimize_run(make_run(ball_task(**changes), tmp_path)))
        assert "the reward does not depend on x" in error

    def test_a_shape_that_overlaps_the_start_of_the_water(self, tmp_path):
        error = self.error_of(lambda: optimize_run(make_run(ball_task(height=0.28), tmp_path)))
        assert "overlaps the start of" in error and "start the water higher" in error

    def test_a_shape_that_leaves_the_container(self, tmp_path):
        task = ball_task(parameters={"x": Parameter(0.45, -1.0, 1.0, 0.01)})
        error = self.error_of(lambda: optimize_run(make_run(task, tmp_path)))
        assert "leaves the container at x 0.45" in error

    def test_no_particle_lands(self, tmp_path):
        error = self.error_of(lambda: optimize_run(make_run(funnel(frames=5), tmp_path)))
        assert "no particle reached the floor, so the reward is undefined" in error

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (("bucket", None), "there is no design 'bucket'; there are bowl, funnel and latent"),
            (("bowl", ["0.1"]), "give two radii in meters"),
            (("bowl", ["0.1,wide"]), "give two radii in meters"),
            (("latent", None), "choose one by its name"),
            (("latent", ["0.1,0.2"]), "--start is for bowl and funnel"),
        ],
    )
    def test_options_without_a_task(self, tmp_path, arguments, message):
        name, start = arguments
        assert message in self.error_of(lambda: tasks_from_options(name, tmp_path, start, None))

    def test_options_of_another_task(self, tmp_path):
        error = self.error_of(lambda: tasks_from_options("bowl", tmp_path, None, None, deepsdf=tmp_path))
        assert "--deepsdf and --shape are for latent" in error


def test_after_an_error_the_designs_so_far_are_saved(tmp_path):
    def reward(end: Outcome) -> torch.Tensor:
        factor = float("nan") if end.parameters["x"] > 0.025 else 1.0
        return end.parameters["x"] * factor

    run = make_run(ball_task(reward=reward), tmp_path)
    with pytest.raises(InputError, match=r"the reward is nan .*iteration 2; the best design so far is saved in"):
        optimize_run(run)
    again = make_run(ball_task(reward=reward), tmp_path)
    resume(again)
    assert again.rewards == run.rewards and len(run.rewards) == 2
    assert '"best"' in (tmp_path / "design.json").read_text()


def test_several_starts_get_a_folder_each(tmp_path):
    folders = [folder for folder, _ in tasks_from_options("bowl", tmp_path, ["0.1,0.02", "0.2,0.03"], None)]
    assert folders == [tmp_path / "start-1", tmp_path / "start-2"]


def test_a_single_start_uses_the_folder_itself(tmp_path):
    assert [folder for folder, _ in tasks_from_options("funnel", tmp_path, ["0.1,0.08"], 20)] == [tmp_path]


def test_the_reward_is_the_same_with_and_without_gradients(simulator):
    # Water that strikes the edge of a bowl, where a volume map and a plane solid differ by more than a gain.
    task, rewards = bowl(), []
    for with_gradient in (True, False):
        values = {name: torch.tensor(value, requires_grad=with_gradient) for name, value in (("r1", 0.2), ("r2", 0.05))}
        with torch.set_grad_enabled(with_gradient):
            rewards.append(task.score(task.simulate(simulator, values, task.initial_state())).item())
    assert rewards[0] == pytest.approx(rewards[1], abs=1e-6)
