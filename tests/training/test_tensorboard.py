import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from surfsup.datasets.windows import Windows
from surfsup.io.trajectory_path import trajectory_files
from surfsup.training import tensorboard as module
from surfsup.training.rollout_picture import draw_rollout
from surfsup.training.run import TrainingRun
from surfsup.training.tensorboard import TensorBoard, open_log
from surfsup.training.train import train
from surfsup.viewing.graphics import missing_packages
from tests.training.conftest import Stop, config, stop_at


def events_of(run: TrainingRun) -> EventAccumulator:
    events = EventAccumulator(str(run.folder / "tensorboard"))
    events.Reload()
    return events


def steps(events: EventAccumulator, name: str) -> list[int]:
    return [event.step for event in events.Scalars(name)]


def test_a_resumed_run_overwrites_the_curves_after_its_checkpoint(tmp_path, data, monkeypatch):
    monkeypatch.setattr(module, "STEPS_PER_POINT", 2)
    run = TrainingRun(config(), tmp_path)
    with pytest.raises(Stop), TensorBoard(run, None) as log:
        train(run, Windows(data), data, report=stop_at(6), log=log)
    resumed = TrainingRun(config(), tmp_path)
    resumed.resume()
    with TensorBoard(resumed, None) as log:
        train(resumed, Windows(data), data, log=log)
    events = events_of(run)
    for name in (
        "loss", "loss by surface/sphere", "error/near the surface", "error/far from the surface", "gradient norm",
        "learning rate", "steps a second",
    ):  # fmt: skip
        assert steps(events, name) == [2, 4, 6, 8]
        assert np.isfinite([event.value for event in events.Scalars(name)]).all()
    assert steps(events, "rollout/chamfer") == [4, 8]
    assert not events.Tags()["images"]


@pytest.mark.skipif(bool(missing_packages()), reason="this machine cannot draw")
def test_a_rollout_is_drawn_where_this_machine_can(tmp_path, data):
    run = TrainingRun(config(steps=1, phases=[{"until": 1}]), tmp_path)
    with open_log(run, data) as log:
        train(run, Windows(data), data, log=log)
    (picture,) = events_of(run).Images("rollout (below: the reference)")
    assert (picture.step, picture.width, picture.height) == (1, 3 * 480, 2 * 360)


@pytest.mark.skipif(bool(missing_packages()), reason="this machine cannot draw")
def test_a_diverged_rollout_is_drawn_without_particles(data):
    model = TrainingRun(config(), data).model.requires_grad_(False)
    for weight in model.parameters():
        weight.fill_(torch.nan)
    picture = draw_rollout(model, trajectory_files(data)[0], 4)
    assert picture.shape == (2 * 360, 3 * 480, 3)


def test_without_graphics_a_warning_says_so(tmp_path, data, monkeypatch):
    def refuse():
        raise module.InputError("pictures need libegl1")

    monkeypatch.setattr(module, "require_graphics", refuse)
    run = TrainingRun(config(steps=1), tmp_path)
    with pytest.warns(UserWarning, match="no pictures of rollouts: pictures need libegl1"), open_log(run, data) as log:
        train(run, Windows(data), data, log=log)
    assert steps(events_of(run), "rollout/chamfer") == [1]
