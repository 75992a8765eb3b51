import numpy as np
import pytest
import torch

from surfsup.datasets.streaming.stream import stream
from surfsup.datasets.streaming.streamed_windows import StreamedWindows, stream_for_training
from surfsup.errors import InputError
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.train import Run, train
from tests.datasets.conftest import needs_solver

pytestmark = [needs_solver, pytest.mark.usefixtures("tiny_recipes")]


def test_windows_are_of_the_last_simulations_that_came_in(tmp_path):
    random = np.random.default_rng(0)
    with stream("tiny", tmp_path, workers=2) as coming:
        windows = StreamedWindows(coming, size=2)
        assert len(windows) == 1
        heights = set()
        while len(heights) < 4:  # each scene has a height of its own
            drawn = windows.draw(random, past=1, frames=2)
            assert drawn.positions.shape == drawn.velocities.shape == (4, 8, 3)
            (before, speed), (after, _) = drawn.frame(0), drawn.frame(1)
            assert (after[:, 2] < before[:, 2]).all()
            heights.add(round(float(before[0, 2] + speed[0, 2] ** 2 / 19.62), 2))
            assert 1 <= len(windows) <= 2


def test_a_window_longer_than_the_scenes_is_refused(tmp_path):
    with stream("tiny", tmp_path, workers=1) as coming:
        windows = StreamedWindows(coming)
        with pytest.raises(InputError, match="of the stream: has 6 frames, training needs at least 7"):
            windows.draw(np.random.default_rng(0), past=1, frames=5)


def test_a_model_is_trained_on_scenes_as_they_are_made(tmp_path):
    generated = tmp_path / "validation"
    from surfsup.datasets.generation.generate import generate

    generate("tiny", generated, 1, seed=1)
    config = TrainingConfig(
        width=4, layers=1, batch=2, steps=4, warm_up=1, judge_every=4, judge_scenes=1, judge_frames=4,
        phases=[Phase(until=1, unseen=1, unroll=2)],
    )  # fmt: skip
    run = Run(config, tmp_path / "run")
    before = [parameter.clone() for parameter in run.model.parameters()]
    with stream_for_training("tiny", run.folder, [config.seed, run.step], workers=1) as coming:
        train(run, StreamedWindows(coming), generated)
    assert run.step == 4
    assert any(not torch.equal(old, new) for old, new in zip(before, run.model.parameters(), strict=True))
    assert (run.folder / "best.safetensors").exists()
