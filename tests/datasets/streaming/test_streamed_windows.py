import numpy as np
import pytest
import torch

from surfsup.datasets.generation.generate import generate
from surfsup.datasets.streaming.stream import open_stream
from surfsup.datasets.streaming.streamed_windows import StreamedWindows, stream_for_training
from surfsup.errors import InputError
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.run import TrainingRun
from surfsup.training.train import train
from tests.datasets.conftest import needs_solver

pytestmark = [needs_solver, pytest.mark.usefixtures("tiny_recipes")]


def test_windows_are_of_the_last_simulations(tmp_path):
    random = np.random.default_rng(0)
    with open_stream("tiny", tmp_path, workers=2) as stream:
        windows = StreamedWindows(stream, size=2)
        assert len(windows) == 1
        heights = set()
        while len(heights) < 4:  # each scene starts at another height
            drawn = windows.sample(random, history_length=1, frames=2)
            assert drawn.positions.shape == drawn.velocities.shape == (4, 8, 3)
            (before, velocity), (after, _) = drawn.frame(0), drawn.frame(1)
            assert (after[:, 2] < before[:, 2]).all()
            heights.add(round(float(before[0, 2] + velocity[0, 2] ** 2 / 19.62), 2))
            assert 1 <= len(windows) <= 2


def test_a_window_longer_than_the_scenes_is_an_error(tmp_path):
    with open_stream("tiny", tmp_path, workers=1) as stream:
        windows = StreamedWindows(stream)
        with pytest.raises(InputError, match="of the stream: has 6 frames, training needs at least 7"):
            windows.sample(np.random.default_rng(0), history_length=1, frames=5)


def test_a_model_trains_on_a_stream(tmp_path):
    generate("tiny", tmp_path / "validation", 1, seed=1)
    config = TrainingConfig(
        kind="corrected", width=4, layers=1, batch=2, steps=4, warm_up=1, validate_every=4, validation_scenes=1,
        validation_frames=4, phases=[Phase(until=1, pushforward=2)],
    )  # fmt: skip
    run = TrainingRun(config, tmp_path / "run")
    before = [parameter.clone() for parameter in run.model.parameters()]
    with stream_for_training("tiny", run.folder, [config.seed, run.step], workers=1) as stream:
        train(run, StreamedWindows(stream), tmp_path / "validation")
    assert run.step == 4
    assert any(not torch.equal(old, new) for old, new in zip(before, run.model.parameters(), strict=True))
    assert (run.folder / "best.safetensors").exists()
