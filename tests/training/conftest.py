import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator
from surfsup.scene import Scene
from surfsup.sph.state import Environment, ParticleState
from surfsup.training.batches import read_batch
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.run import Run

FRAMES = 14
SCENE = Scene.from_yaml(
    "container: {size: [0.4, 0.4, 0.6]}\n"
    "surface: {sphere: {radius: 0.1}, at: [0, 0, 0.1]}\n"
    f"frames: {FRAMES}\n"
    "fluid: [{block: {min: [-0.08, -0.08, 0.22], max: [0.07, 0.07, 0.44], velocity: [0, 0, -1.4]}}]",
    "test",
)
MESSAGE_PASSING = ("surfsup", "value-only", "no-sdf", "gns")


def write_fall(path, scene: Scene) -> None:
    """Water that falls onto the ball, as a network corrects it that knows nothing."""
    surface = scene.build_surface()
    start = scene.start(surface)
    environment = Environment.of(scene, surface)
    torch.manual_seed(0)
    simulator = CorrectedSimulator(Architecture(width=8, layers=1)).requires_grad_(False)
    simulator.network.decoder[-1].weight.normal_(std=2.0)
    state = ParticleState(torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities))
    with TrajectoryWriter(path, scene, Provenance("some fall"), len(start.positions)) as writer:
        for now, _ in simulator.rollout(state, environment, scene.frames):
            writer.append(now.positions.numpy(), now.velocities.numpy())


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """A folder of two tiny trajectories."""
    folder = tmp_path_factory.mktemp("data")
    write_fall(folder / "00000.h5", SCENE)
    write_fall(folder / "00001.h5", SCENE.model_copy(update={"gravity": (0.5, 0.0, -9.0)}))
    return folder


def config(**changes) -> TrainingConfig:
    """A tiny run of eight steps."""
    standard = {
        "width": 6,
        "layers": 2,
        "batch": 2,
        "steps": 8,
        "warm_up": 3,
        "judge_every": 4,
        "judge_scenes": 1,
        "judge_frames": 6,
        "seed": 5,
        # One step of each kind of phase is enough to see that what is random in it repeats.
        "phases": [
            Phase(until=0.5),
            Phase(until=0.75, unseen=2, unroll=2),
            Phase(until=1, unseen=1, unroll=2, noise=0),
        ],
    }
    return TrainingConfig(**{**standard, **changes})


def message_passing(kind: str, **changes) -> TrainingConfig:
    """The same of one of the paper's networks."""
    sizes = {"surface_particles": 40} if kind == "gns" else {}
    phases = [Phase(until=0.5), Phase(until=1, unseen=1, unroll=2)]
    return config(**{"kind": kind, "phases": phases, "history": 2, **sizes, **changes})


def batch_of(run: Run, data, step: int = 0):
    return read_batch(Windows(data), run, step)


def fresh() -> list[np.random.Generator]:
    return [np.random.default_rng(number) for number in range(2)]


class Stop(Exception):
    pass


def stop_at(step: int):
    def report(progress) -> None:
        if progress.step == step:
            raise Stop

    return report


def assert_same(one: Run, other: Run) -> None:
    assert one.step == other.step
    for mine, theirs in ((one.model, other.model), (one.average, other.average)):
        for name, value in mine.state_dict().items():
            assert torch.equal(value, theirs.state_dict()[name]), name
    ours, others = one.plain_optimizer.state_dict()["state"], other.plain_optimizer.state_dict()["state"]
    assert all(torch.equal(ours[i][key], others[i][key]) for i in ours for key in ours[i])
