"""Everything is on one device; simulated_gpu.py says what these tests can find."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from surfsup.io.output_folder import PenetrationCounter
from surfsup.learned.base import LearnedSimulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from tests.learned.simulated_gpu import simulated_gpu

KNOT = Path(__file__).parents[2] / "examples" / "knot.obj"
TERRAIN = "TERRAIN"  # stands for a file
SURFACES = {
    "nothing": "null",
    "ball": "{sphere: {radius: 0.2}, at: [0, 0, 0.2]}",
    "solids": """{union: [
        {box: {size: [0.3, 0.3, 0.2]}, at: [0, 0, 0.1]},
        {torus: {major_radius: 0.2, minor_radius: 0.05}, at: [0, 0, 0.25]},
        {bowl: {capture_radius: 0.2, filter_radius: 0.05}, at: [0, 0, 0.4]}]}""",
    "cut": """{difference: [
        {cylinder: {radius: 0.2, height: 0.4}, at: [0, 0, 0.2]},
        {cone: {height: 0.3, bottom_radius: 0.1}, at: [0, 0, 0.3]}]}""",
    "mesh": f"{{mesh: {{file: {KNOT}, fit: 0.4}}}}",
    "turned mesh": f"{{mesh: {{file: {KNOT}, fit: 0.4}}, at: [0.01, 0, 0], rotate: {{axis: [0, 0, 1], degrees: 20}}}}",
    "terrain": f"{{heightfield: {{file: {TERRAIN}, size: [1, 1], height: 0.35}}}}",
    "siren": "{siren: {file: coral, fit: 0.4}}",
    "deepsdf": "{deepsdf: {file: chairs, shape: chair-0100, fit: 0.4}, at: [0, 0, 0.2]}",
}
FRAMES = 12  # the water has struck the surface


def make_scene(surface: str) -> Scene:
    text = f"surface: {surface}\nframes: {FRAMES}\nfluid: [{{block: {{min: [-0.1, -0.1, 0.42], max: [0.1, 0.1, 0.52], "
    return Scene.from_yaml(text + "velocity: [0, 0, -3]}}]", "test")


def make_simulator(kind: str) -> LearnedSimulator:
    torch.manual_seed(0)
    return LEARNED_SIMULATORS[kind](LEARNED_SIMULATORS[kind].architecture_type())


def rollout(scene: Scene, device: str) -> list[np.ndarray]:
    """The frames of the default simulator; each is checked against the surface on the CPU, as the command line does."""
    simulation = Simulation(scene, device=device)
    frames = [frame.positions for frame in simulation.run()]
    penetrations_of = PenetrationCounter(scene.container, simulation.motion.solids)
    assert all(penetrations_of.count(frame, {}) == (0, 0) for frame in frames)
    return frames


@pytest.mark.parametrize("surface", SURFACES)
def test_the_default_simulator_on_any_surface(surface, tmp_path):
    terrain = tmp_path / "terrain.npy"
    np.save(terrain, np.outer(*2 * [np.hanning(20)]))
    scene = make_scene(SURFACES[surface].replace(TERRAIN, str(terrain)))
    with torch.no_grad():
        expected = rollout(scene, "cpu")
        with simulated_gpu() as gpu:
            found = rollout(scene, str(gpu))
    # Rounding errors grow from the impact on, to less than a millimeter.
    np.testing.assert_allclose(np.stack(found), np.stack(expected), atol=1e-3, rtol=0)


@pytest.mark.parametrize("with_map", [True, False])
def test_the_gradients_of_the_default_simulator(with_map):
    scene = make_scene(SURFACES["ball"])
    start = scene.initial_particles(scene.build_surface())

    def gradients(device: str) -> list[torch.Tensor]:
        environment = Environment.of(scene, scene.build_surface(), device)
        if not with_map:
            environment = replace(environment, boundary_map=None)
        positions = torch.from_numpy(start.positions - [0, 0, 0.01]).float().to(device).requires_grad_()
        velocities = torch.from_numpy(start.velocities).to(device).requires_grad_()
        after, _ = DfsphSolver().step(ParticleState(positions, velocities), environment)
        found = torch.autograd.grad(after.velocities.square().sum(), [positions, velocities])
        return [gradient.cpu() for gradient in found]

    expected = gradients("cpu")
    with simulated_gpu() as gpu:
        found = gradients(str(gpu))
    for ours, theirs in zip(found, expected, strict=True):
        torch.testing.assert_close(ours, theirs, atol=1e-5 * float(theirs.abs().max()), rtol=0)


@pytest.mark.parametrize("kind", LEARNED_SIMULATORS)
def test_every_learned_simulator_and_its_gradients(kind):
    scene = make_scene(SURFACES["ball"])

    def run(device: str) -> tuple[torch.Tensor, list[torch.Tensor]]:
        simulator, environment = make_simulator(kind).to(device), Environment.of(scene, scene.build_surface(), device)
        start = scene.initial_particles(scene.build_surface())
        positions = torch.from_numpy(start.positions - [0, 0, 0.05]).float().to(device)
        state = simulator.initial_state(positions, torch.from_numpy(start.velocities).to(device), environment)
        after, _ = simulator.step(state, environment)
        torch.autograd.backward(after.velocities.square().sum())
        gradients = [weight.grad.cpu() for weight in simulator.parameters() if weight.grad is not None]
        return after.positions.detach().cpu(), gradients

    positions, gradients = run("cpu")
    with simulated_gpu() as gpu:
        on_gpu = run(str(gpu))
    torch.testing.assert_close(on_gpu[0], positions, atol=1e-6, rtol=0)
    assert len(gradients) == len(on_gpu[1]) > 0
    for ours, theirs in zip(on_gpu[1], gradients, strict=True):  # by torch and by C++: a ReLU near zero may differ
        torch.testing.assert_close(ours, theirs, atol=1e-5 + 1e-3 * float(theirs.abs().max()), rtol=0)


def test_the_simulated_gpu_finds_tensors_on_the_wrong_device():
    with simulated_gpu() as gpu:
        there = torch.ones(3, device=gpu)
        assert there.device == gpu and there.cpu().device.type == "cpu" and (there * 2).device == gpu
        with pytest.raises(RuntimeError, match="the same device"):
            there + torch.ones(3)
        with pytest.raises(RuntimeError, match="numpy"):
            there.numpy()
