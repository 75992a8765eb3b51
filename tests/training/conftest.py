import pytest
import torch

from surfsup.model.simulator import Simulator
from surfsup.model.state import State, Surroundings
from surfsup.scene import Scene
from surfsup.trajectory import Provenance, TrajectoryWriter

FRAMES = 14
SCENE = Scene.from_yaml(
    "container: {size: [0.4, 0.4, 0.6]}\n"
    "surface: {sphere: {radius: 0.1}, at: [0, 0, 0.1]}\n"
    f"frames: {FRAMES}\n"
    "fluid: [{block: {min: [-0.08, -0.08, 0.22], max: [0.07, 0.07, 0.34], velocity: [0, 0, -2]}}]",
    "test",
)


def write_fall(path, scene: Scene) -> None:
    """Water that falls onto the ball: ballistic, kept out of the ball by the guard alone."""
    from surfsup.model.simulator import Architecture

    surface = scene.build_surface()
    start = scene.start(surface)
    around = Surroundings.of(scene, surface)
    simulator = Simulator(Architecture(width=2, layers=1))
    for parameter in simulator.parameters():
        torch.nn.init.zeros_(parameter)
    state = State.in_free_fall(
        torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities), around.gravity
    )
    with TrajectoryWriter(path, scene, Provenance("guarded fall"), len(start.positions)) as writer:
        for now, _ in simulator.rollout(state, around, scene.frames):
            writer.append(now.positions.numpy(), now.velocities.numpy())


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """A folder of two tiny trajectories."""
    folder = tmp_path_factory.mktemp("data")
    write_fall(folder / "00000.h5", SCENE)
    write_fall(folder / "00001.h5", SCENE.model_copy(update={"gravity": (0.5, 0.0, -9.0)}))
    return folder
