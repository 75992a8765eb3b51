import numpy as np
import pytest
import torch

from surfsup.evaluation.metrics import kd_tree, max_density
from surfsup.native.dispatch import is_built
from surfsup.scene import Block, Container, Scene
from surfsup.sdf import Sphere, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.fast_frames import MAX_PARTS, frame_parts
from surfsup.sph.native_solver import NativeSolver
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import FRAME_TIME, FramePart, ParticleState


def moving(speed: float, count: int = 200) -> torch.Tensor:
    return torch.tensor([[0.0, 0.6, -0.8]]).repeat(count, 1) * speed


@pytest.mark.parametrize(
    ("speed", "parts"), [(0.0, 1), (14.9, 1), (15.1, 3), (23.9, 4), (25.0, 5), (1e4, MAX_PARTS), (float("nan"), 1)]
)
def test_water_that_crosses_half_a_spacing_in_a_substep_then_crosses_a_fifth(speed, parts):
    assert frame_parts(moving(speed)) == parts


def test_a_few_fast_particles_do_not_count():
    velocities = moving(5.0)
    velocities[:1] *= 20
    assert frame_parts(velocities) == 1
    velocities[:2] *= 20
    assert frame_parts(velocities) > 1
    assert frame_parts(velocities[:0]) == 1


def thrown_at_a_ball(speed: float) -> tuple[Environment, ParticleState]:
    ball = Transformed(Sphere(0.3), translation=(0.0, 0.0, 0.6))
    block = Block((-0.15, -0.15, 0.95), (0.15, 0.15, 1.25), velocity=(0.0, 0.0, -speed))
    scene = Scene(surface=ball, container=Container(size=(3, 3, 3)), fluid=[block])
    start = scene.initial_particles(ball)
    return Environment.of(scene, ball), ParticleState(*map(torch.from_numpy, (start.positions, start.velocities)))


@pytest.mark.skipif(not is_built(), reason="Warp has one length of substeps")
def test_fast_water_is_not_compressed_where_it_strikes():
    environment, state = thrown_at_a_ball(25.0)
    parted, whole, solver, plain = state, state, DfsphSolver(), NativeSolver()
    densities = []
    for _ in range(6):
        parted, _ = solver.step(parted, environment)
        frame = plain.step(whole, environment)
        whole = ParticleState(frame.positions, frame.velocities)
        densities.append([max_density(kd_tree(one.positions.numpy())) for one in (parted, whole)])
        assert environment.distance_and_normal(parted.positions)[0].min() > 0
    assert np.max(densities, axis=0)[0] < 1.1 < 2 < np.max(densities, axis=0)[1]


@pytest.mark.skipif(not is_built(), reason="Warp has one length of substeps")
def test_slow_water_takes_the_frame_of_the_solver_bit_for_bit():
    environment, state = thrown_at_a_ball(8.0)
    stepped, _ = DfsphSolver().step(state, environment)
    frame = NativeSolver().step(state, environment)
    assert torch.equal(stepped.positions, frame.positions) and torch.equal(stepped.velocities, frame.velocities)


@pytest.mark.skipif(not is_built(), reason="Warp has one length of substeps")
def test_the_parts_of_a_frame_of_free_fall_add_up_to_a_frame():
    gravity = torch.tensor([0.0, 0.0, -9.81])
    state = ParticleState(torch.zeros(200, 3), moving(30.0))
    falling = state
    for _ in range(3):
        falling = ParticleState(*falling.ballistic(gravity, FramePart(FRAME_TIME / 3)))
    torch.testing.assert_close(falling.velocities, state.velocities + FRAME_TIME * gravity)
    positions, _ = state.ballistic(gravity)
    # Semi-implicit steps of 1/3 ms lag less behind the parabola than those of 1 ms.
    assert (falling.positions - positions).abs().max() < 2e-5
