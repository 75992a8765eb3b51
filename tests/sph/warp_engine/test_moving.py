"""Moving solids in Warp: as in C++, and with gradients in the particles and in the poses."""

from typing import ClassVar

import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup.errors import InputError
from surfsup.scene import SPACING, Scene
from surfsup.scene.solids import CONTAINER
from surfsup.sph.clearance import CLEARANCE
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from tests.sph.test_moving import line, simulation_of
from tests.sph.warp_engine.test_solver import needs_cpp

SCENES = {
    "a paddle and a ball": (
        "container: {size: [0.6, 0.6, 1]}\nsurfaces:\n  step: {box: {size: [0.1, 0.6, 0.1]}, at: [-0.25, 0, 0.05]}\n"
        "  paddle: {box: {size: [0.3, 0.04, 0.1]}, at: [0, -0.1, 0.06], motion: {spin: {turns: 2}}}\n"
        "  ball: {sphere: {radius: 0.08}, at: [0.1, 0.1, 0.3],"
        " motion: {keyframes: [{time: 0}, {time: 0.2, position: [0.1, 0, 0.15]}]}}\n"
        "fluid: [{block: {min: [-0.18, -0.2, 0.15], max: [0.2, 0.2, 0.25], velocity: [0, 0, -1]}}]"
    ),
    "a tilted container": (
        "container: {size: [0.5, 0.3, 0.5],"
        " motion: {keyframes: [{time: 0}, {time: 0.3, rotation: {axis: [0, 1, 0], degrees: 25}}]}}\n"
        "fluid: [{block: {min: [-0.18, -0.08, 0.06], max: [0.18, 0.08, 0.14]}}]"
    ),
    "a carried cup": (
        "container: {size: [2, 2, 2]}\nsurfaces:\n  cup:\n    difference:\n"
        "    - {cylinder: {radius: 0.15, height: 0.2}, at: [0, 0, 0.1]}\n"
        "    - {cylinder: {radius: 0.11, height: 1}, at: [0, 0, 0.54]}\n"
        "    at: [-0.5, 0, 0.2]\n    motion: {keyframes: [{time: 0}, {time: 0.4, position: [0, 0.3, 0.7],"
        " rotation: {axis: [1, 0, 0], degrees: 60}}]}\n"
        "fluid: [{block: {min: [-0.58, -0.08, 0.27], max: [-0.42, 0.08, 0.38]}}]"
    ),
    "a fast plate and no container": (
        "container: none\ngravity: [0, 0, 0]\n"
        f"surfaces: {{plate: {{box: {{size: [1, 1, 0.1]}}, motion: {line([0, 0, -0.2], [0, 0, 4])}}}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0], max: [0.1, 0.1, 0.12]}}]"
    ),
}


def in_warp(text: str) -> sf.Simulation:
    solver = DfsphSolver()
    solver.native = None
    return sf.Simulation(Scene.from_yaml(text, "test"), solver)


@needs_cpp
@pytest.mark.parametrize("name", SCENES)
def test_a_rollout_of_fifty_frames_equals_that_in_cpp(name):
    in_cpp, simulation = simulation_of(SCENES[name]), in_warp(SCENES[name])
    for number in range(50):
        # Contact is chaotic: rounding grows tenfold in ten to twenty frames.
        if name in ("a paddle and a ball", "a fast plate and no container") and number % 20 == 19:
            simulation.reset(in_cpp.state)
        expected, found = in_cpp.step(), simulation.step()
        np.testing.assert_allclose(found.positions, expected.positions, atol=1e-5)
        np.testing.assert_allclose(found.velocities, expected.velocities, atol=5e-3)
    assert np.abs(found.velocities).max() > 0.1


def test_a_scene_that_moves_as_a_whole_is_the_scene_at_rest():
    velocity = (1.3, -0.7, 0.4)
    text = (
        "container: none\nsurfaces: {block: {box: {size: [0.3, 0.3, 0.1]}, at: [0, 0, 0.05]%s}}\n"
        "fluid: [{block: {min: [-0.12, -0.12, 0.14], max: [0.12, 0.12, 0.4], velocity: [%g, %g, %g]}}]"
    )
    still = in_warp(text % ("", 0, 0, 0))
    moved = in_warp(text % (f", motion: {line([0, 0, 0.05], velocity)}", *velocity))
    assert still.surface is not None and moved.surface is None
    for _ in range(15):
        here, there = still.step(), moved.step()
    np.testing.assert_allclose(there.positions, here.positions + np.array(velocity) * here.time, atol=2e-6)
    np.testing.assert_allclose(there.velocities, here.velocities + velocity, atol=2e-4)


@pytest.mark.parametrize("speed", [2.5, 14.0, 45.0])
def test_a_thin_plate_passes_no_particle(speed):
    simulation = in_warp(
        "container: none\ngravity: [0, 0, 0]\n"
        f"surfaces: {{plate: {{box: {{size: [1.6, 1.6, 0.001]}}, motion: {line([0, 0, -0.05], [0, 0, speed])}}}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0], max: [0.1, 0.1, 0.12]}}]"
    )
    for _ in range(max(3, int(0.12 / speed / 0.005))):
        frame = simulation.step()
        above = frame.positions[:, 2] - frame.poses["plate"].position[2]
        assert (above[np.abs(frame.positions[:, :2]).max(axis=1) < 0.8] > 0.9 * CLEARANCE).all()
    assert frame.velocities[:, 2].max() > 0.9 * speed


def test_frames_between_steps_are_out_of_the_solid():
    simulation = in_warp(SCENES["a fast plate and no container"])
    for frame in simulation.run(seconds=0.04, fps=170):
        assert (frame.positions[:, 2] - frame.poses["plate"].position[2]).min() > 0.05 + 0.9 * CLEARANCE


def test_an_environment_without_the_poses_of_what_moves_is_refused():
    simulation = in_warp(SCENES["a tilted container"])
    with pytest.raises(InputError, match="solids that move, which this use of the solver does not know"):
        simulation._simulator.step(simulation.state.fluid, simulation._environment)


class TestGradients:
    """Against central differences in double precision."""

    AT: ClassVar = {
        "ball": [[0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0], [0.002, -0.001, 0.104, 0.99, 0.03, 0.02, -0.02]],
        "bar": [[0.2, 0.0, 0.1, 0.9, 0.3, 0.0, 0.1], [0.2, 0.0, 0.102, 0.9, 0.32, 0.02, 0.1]],
        CONTAINER: [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.003, 0.001, 0.002, 0.99, 0.0, 0.02, 0.0]],
    }
    SCENE = (
        "container: {size: [0.7, 0.7, 0.7], motion: {spin: {rate: 0}}}\nsurfaces:\n"
        "  ball: {sphere: {radius: 0.1}, at: [0, 0, 0.1], motion: {spin: {rate: 0}}}\n"
        "  bar: {box: {size: [0.1, 0.4, 0.05]}, at: [0.2, 0, 0.1], motion: {spin: {rate: 0}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.6]}}]"
    )

    @pytest.fixture
    def environment(self) -> Environment:
        return in_warp(self.SCENE)._environment

    def state(self, environment: Environment) -> ParticleState:
        """Water that falls on what moves and on the floor, of which none is within the clearance at the start."""
        random = torch.Generator().manual_seed(3)
        grid = torch.cartesian_prod(*(SPACING * torch.arange(count).double() for count in (14, 8, 8)))
        positions = grid + torch.tensor([-0.15, -0.12, 0.03])
        positions = positions + 0.01 * torch.rand(positions.shape, generator=random, dtype=torch.float64)
        ends = self.poses()
        motion = environment.moving.between_tensors(ends)
        start = motion.places(1).at(0)
        with torch.no_grad():
            room = torch.stack(
                [body.surface.distance(start.of(number).to_own(positions)) for number, body in enumerate(motion.bodies)]
            ).amin(dim=0)
        positions = positions[(room > 0.0205) & (room < 0.07)]
        velocities = torch.randn(len(positions), 3, generator=random, dtype=torch.float64)
        return ParticleState(positions, velocities + torch.tensor([0.0, 0.0, -12.0]))

    def poses(self) -> dict[str, torch.Tensor]:
        return {name: torch.tensor(values, dtype=torch.float64) for name, values in self.AT.items()}

    def check(self, environment: Environment, frames: int, scale: float = 1.0) -> None:
        state, solver = self.state(environment), DfsphSolver()
        weights = torch.randn(2, *state.positions.shape, generator=torch.Generator().manual_seed(5)).double()
        poses = self.poses()
        for ends in poses.values():
            ends[1] = ends[0] + scale * (ends[1] - ends[0])
        collided = []

        def total(positions: torch.Tensor, velocities: torch.Tensor, *ends: torch.Tensor) -> torch.Tensor:
            now = ParticleState(positions, velocities)
            for number in range(frames):
                shifted = {
                    name: torch.stack([pose[0] + number * (pose[1] - pose[0]), pose[1] + number * (pose[1] - pose[0])])
                    for name, pose in zip(poses, ends, strict=True)
                }
                now, moved = solver.step(now, environment.moved(environment.moving.between_tensors(shifted)))
                collided.append(int(moved.sum()))
            return (weights[0] * now.positions).sum() + 0.1 * (weights[1] * now.velocities).sum()

        inputs = [value.requires_grad_() for value in (state.positions, state.velocities, *poses.values())]
        found = torch.autograd.grad(total(*inputs), inputs)
        assert collided[0] > 3 and all(gradient.abs().max() > 0 for gradient in found)
        for seed in range(4):
            random = torch.Generator().manual_seed(seed)
            along = [torch.randn(value.shape, generator=random, dtype=torch.float64) for value in inputs]
            step = 1e-8
            with torch.no_grad():
                ends = [
                    total(*(value + sign * step * part for value, part in zip(inputs, along, strict=True)))
                    for sign in (1, -1)
                ]
            difference = float(ends[0] - ends[1]) / (2 * step)
            product = float(sum((one * part).sum() for one, part in zip(found, along, strict=True)))
            assert product == pytest.approx(difference, rel=1e-4, abs=1e-4)

    def test_of_a_frame(self, environment):
        self.check(environment, 1)

    def test_of_three_frames(self, environment):
        self.check(environment, 3)

    def test_of_a_frame_in_pieces(self, environment):
        self.check(environment, 1, scale=3.0)

    def test_of_what_stands_still_but_could_move(self, environment):
        self.check(environment, 1, scale=0.0)

    def test_a_frame_with_gradients_is_the_same_frame(self, environment):
        state = self.state(environment)
        results = []
        for with_gradient in (True, False):
            poses = {name: ends.requires_grad_(with_gradient) for name, ends in self.poses().items()}
            results.append(DfsphSolver().step(state, environment.moved(environment.moving.between_tensors(poses))))
        assert results[0][0].positions.requires_grad and not results[1][0].positions.requires_grad
        assert torch.equal(results[0][0].positions, results[1][0].positions)
