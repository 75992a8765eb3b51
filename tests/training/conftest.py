from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.learned.corrected.simulator import CorrectedArchitecture, CorrectedSimulator
from surfsup.scene import Scene
from surfsup.sph.environment import Environment
from surfsup.sph.state import ParticleState
from surfsup.training.batches import read_batch
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.objectives import Batch
from surfsup.training.run import TrainingRun

FRAMES = 14
SCENE = Scene.from_yaml(
    "container: {size: [0.4, 0.4, 0.6]}\n"
    "surface: {sphere: {radius: 0.1}, at: [0, 0, 0.1]}\n"
    f"frames: {FRAMES}\n"
    "fluid: [{block: {min: [-0.08, -0.08, 0.22], max: [0.07, 0.07, 0.44], velocity: [0, 0, -1.4]}}]",
    "test",
)
MESSAGE_PASSING = ("surfsup", "value-only", "no-sdf", "gns")


def write_trajectory(path, scene: Scene) -> None:
    """Water that falls onto the ball, corrected by a random network."""
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    environment = Environment.of(scene, surface)
    torch.manual_seed(0)
    simulator = CorrectedSimulator(CorrectedArchitecture(width=8, layers=1)).requires_grad_(False)
    simulator.network.decoder[-1].weight.normal_(std=2.0)
    state = ParticleState(torch.from_numpy(start.positions), torch.from_numpy(start.velocities))
    with TrajectoryWriter(path, scene, Provenance("random"), len(start.positions)) as writer:
        for now, _ in simulator.rollout(state, environment, scene.frames):
            writer.append(now.positions.numpy(), now.velocities.numpy())


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """A folder of two tiny trajectories."""
    folder = tmp_path_factory.mktemp("data")
    write_trajectory(folder / "00000.h5", SCENE)
    write_trajectory(folder / "00001.h5", SCENE.model_copy(update={"gravity": (0.5, 0.0, -9.0)}))
    return folder


def config(**changes: Any) -> TrainingConfig:
    """A tiny run of eight steps with the corrected simulator."""
    standard = {
        "kind": "corrected",
        "width": 6,
        "layers": 2,
        "batch": 2,
        "steps": 8,
        "warm_up": 3,
        "validate_every": 4,
        "validation_scenes": 1,
        "validation_frames": 6,
        "seed": 5,
        # Each kind of phase uses random numbers in its own way; all of them must repeat.
        "phases": [
            Phase(until=0.5),
            Phase(until=0.75, pushforward=2),
            Phase(until=1, pushforward=1, noise=0),
        ],
    }
    return TrainingConfig(**{**standard, **changes})


def message_passing(kind: str, **changes: Any) -> TrainingConfig:
    """The same with one of the paper's networks."""
    sizes = {"surface_particles": 40} if kind == "gns" else {}
    phases = [Phase(until=0.5), Phase(until=1, pushforward=1)]
    return config(**{"kind": kind, "phases": phases, **sizes, **changes})


def batch_of(run: TrainingRun, data, step: int = 0) -> Batch:
    return read_batch(Windows(data), run, step)


def generators() -> list[np.random.Generator]:
    return [np.random.default_rng(number) for number in range(2)]


class Stop(Exception):
    pass


def stop_at(step: int):
    def report(progress) -> None:
        if progress.step == step:
            raise Stop

    return report


def assert_same(one: TrainingRun, other: TrainingRun) -> None:
    assert one.step == other.step
    for mine, theirs in ((one.model, other.model), (one.average, other.average)):
        for name, value in mine.state_dict().items():
            assert torch.equal(value, theirs.state_dict()[name]), name
    ours, others = one.optimizer.state_dict()["state"], other.optimizer.state_dict()["state"]
    assert all(torch.equal(ours[i][key], others[i][key]) for i in ours for key in ours[i])
