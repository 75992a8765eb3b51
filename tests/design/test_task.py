from dataclasses import replace

import pytest
import torch

from surfsup.design import Outcome, Parameter, Task, bowl, funnel, near
from surfsup.design import climb as climbing
from surfsup.design.folder import resume
from surfsup.design.paper_tasks import asked_tasks
from surfsup.design.parameter import starts, within
from surfsup.design.run import DesignRun
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


def run_of(task, simulator, folder, **more) -> DesignRun:
    folder.mkdir(exist_ok=True)
    return DesignRun(task, folder, simulator, "fast", **more)


def climb(run: DesignRun, most: int = 10**9) -> DesignRun:
    climbing.climb(run, lambda: len(run.rewards) >= most, lambda progress: None)
    return run


class TestTheVessels:
    @pytest.mark.parametrize(("task", "radii"), [(bowl(), (0.07, 0.05)), (funnel(), (0.10, 0.09))])
    def test_start_as_in_the_paper(self, task, radii):
        assert [float(value) for value in starts(task.parameters).values()] == pytest.approx(radii)

    @pytest.mark.parametrize("make", [bowl, funnel])
    def test_fit_the_scene_in_all_of_their_range(self, make):
        task = make()
        water, r1 = task.water(), task.parameters["r1"]
        for capture in (r1.lower, r1.upper):
            for hole in (0.0, 1.0):
                values = {"r1": torch.tensor(capture), "r2": torch.tensor(hole)}
                task.surface(within(task.parameters, values), water)

    def test_have_frames_beyond_the_start(self):
        assert bowl().scene.frames == 51 and funnel().scene.frames == 76 and bowl(frames=9).scene.frames == 10


class TestWhatCannotBeDesignedIsToldInOneLine:
    def complaint(self, call) -> str:
        with pytest.raises(InputError) as caught:
            call()
        assert "\n" not in str(caught.value)
        return str(caught.value)

    @pytest.mark.parametrize(
        ("task", "told"),
        [
            (lambda: bowl(0.5, 0.05), "the start of r1 is 0.5, outside what is possible here: 0.06 to 0.3"),
            (lambda: bowl(0.1, 0.09), "the start of r2 is 0.09, outside what is possible here: 0 to 0.08"),
            (lambda: bowl(0.1, -0.01), "the start of r2 is -0.01"),
            (lambda: bowl(float("nan"), 0.05), "the start of r1 is nan"),
            (lambda: funnel(0.2, 0.03), "the start of r2 is 0.03, outside what is possible here: 0.065 to 0.19"),
        ],
    )
    def test_a_start_outside_the_range(self, simulator, tmp_path, task, told):
        assert told in self.complaint(lambda: run_of(task(), simulator, tmp_path))

    @pytest.mark.parametrize("value", ["nan", "inf"])
    def test_a_reward_that_is_no_number(self, simulator, tmp_path, value):
        task = ball_task(reward=lambda end: end.positions.sum() * float(value))
        assert f"the reward is {value} at x 0.01" in self.complaint(lambda: climb(run_of(task, simulator, tmp_path)))

    @pytest.mark.parametrize("reward", [lambda end: 3.0, lambda end: end.positions[:, 0]])
    def test_a_reward_that_is_not_one_number_in_a_tensor(self, simulator, tmp_path, reward):
        task = ball_task(reward=reward)
        assert "must be one number" in self.complaint(lambda: climb(run_of(task, simulator, tmp_path)))

    @pytest.mark.parametrize(
        "changes",
        [
            {"reward": lambda end: end.positions.detach().sum()},
            {"shape": lambda x: Transformed(Sphere(0.1), translation=(0.0, 0.0, 0.15))},
            {"scene": SCENE.with_frames(2), "height": 0.12},
        ],
    )
    def test_a_reward_that_does_not_depend_on_the_shape(self, simulator, tmp_path, changes):
        complaint = self.complaint(lambda: climb(run_of(ball_task(**changes), simulator, tmp_path)))
        assert "the reward does not depend on x" in complaint

    def test_a_shape_that_swallows_the_start_of_the_water(self, simulator, tmp_path):
        complaint = self.complaint(lambda: climb(run_of(ball_task(height=0.28), simulator, tmp_path)))
        assert "swallows the start of" in complaint and "start the water higher" in complaint

    def test_a_shape_that_leaves_the_container(self, simulator, tmp_path):
        task = ball_task(parameters={"x": Parameter(0.45, -1.0, 1.0, 0.01)})
        complaint = self.complaint(lambda: climb(run_of(task, simulator, tmp_path)))
        assert "reaches out of the container at x 0.45" in complaint

    def test_nothing_that_lands(self, simulator, tmp_path):
        complaint = self.complaint(lambda: climb(run_of(funnel(frames=5), simulator, tmp_path)))
        assert "no particle reached the floor, so the reward is undefined" in complaint

    def test_a_simulator_without_gradients_here(self, tmp_path):
        from surfsup.learned.registry import KINDS

        kind = KINDS["no-sdf"]
        other = kind(kind.architecture_type())
        assert "is of kind 'no-sdf'" in self.complaint(lambda: run_of(bowl(), other, tmp_path))

    @pytest.mark.parametrize(
        ("arguments", "told"),
        [
            (("bucket", None), "there is no design 'bucket'; there are bowl, funnel and latent"),
            (("bowl", ["0.1"]), "give two radii in meters"),
            (("bowl", ["0.1,wide"]), "give two radii in meters"),
            (("latent", None), "choose one by its name"),
            (("latent", ["0.1,0.2"]), "--start is of bowl and funnel"),
        ],
    )
    def test_what_is_asked_for(self, tmp_path, arguments, told):
        name, start = arguments
        assert told in self.complaint(lambda: asked_tasks(name, tmp_path, start, None))

    def test_options_of_another_task(self, tmp_path):
        complaint = self.complaint(lambda: asked_tasks("bowl", tmp_path, None, None, deepsdf=tmp_path))
        assert "--deepsdf and --shape are of latent" in complaint


class TestWhenItGoesWrongOnTheWay:
    def test_the_last_good_design_is_kept_and_named(self, simulator, tmp_path):
        def reward(end: Outcome) -> torch.Tensor:
            bad = float("nan") if end.parameters["x"] > 0.025 else 1.0
            return end.parameters["x"] * bad

        run = run_of(ball_task(reward=reward), simulator, tmp_path)
        with pytest.raises(InputError, match=r"the reward is nan .*iteration 2; the best design so far is kept in"):
            climb(run)
        again = run_of(ball_task(reward=reward), simulator, tmp_path)
        resume(again)
        assert again.rewards == run.rewards and len(run.rewards) == 2
        assert '"best"' in (tmp_path / "design.json").read_text()


class TestSeveralStarts:
    def test_get_a_folder_each(self, tmp_path):
        folders = [folder for folder, _ in asked_tasks("bowl", tmp_path, ["0.1,0.02", "0.2,0.03"], None)]
        assert folders == [tmp_path / "start-1", tmp_path / "start-2"]

    def test_but_one_has_the_folder_itself(self, tmp_path):
        assert [folder for folder, _ in asked_tasks("funnel", tmp_path, ["0.1,0.08"], 20)] == [tmp_path]
