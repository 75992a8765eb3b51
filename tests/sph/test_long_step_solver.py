import pytest
import torch

from surfsup.errors import InputError
from surfsup.evaluation.metrics import kd_tree, max_density
from surfsup.native.dispatch import is_built
from surfsup.scene import Block, Container, Scene
from surfsup.sdf import Sphere, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.long_step_solver import LongStepSolver, LongStepState, free_fall
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState

pytestmark = pytest.mark.skipif(not is_built(), reason="long steps run in C++ only")


def falling(height: float, speed: float = 1.0) -> tuple[Environment, LongStepState]:
    """A block whose lowest particles are ``height`` above the top of a ball of 0.2 m."""
    ball = Transformed(Sphere(0.2), translation=(0.0, 0.0, 0.2))
    block = Block((-0.1, -0.1, 0.4 + height), (0.1, 0.1, 0.6 + height), velocity=(0.0, 0.0, -speed))
    scene = Scene(surface=ball, container=Container(size=(1, 1, 2)), fluid=[block])
    start = scene.initial_particles(ball)
    positions, velocities = torch.from_numpy(start.positions), torch.from_numpy(start.velocities)
    return Environment.of(scene, ball), LongStepState(positions, velocities)


def particles(state: LongStepState) -> ParticleState:
    return ParticleState(state.positions, state.velocities)


def test_four_frames_are_one_long_step():
    environment, state = falling(0.03)
    solver = LongStepSolver()
    whole, _ = LongStepSolver().long_step(particles(state), environment)
    for passed in (1, 2, 3):
        state, _ = solver.step(state, environment)
        assert state.passed == passed
        torch.testing.assert_close(state.ends[1].positions, whole.positions, rtol=0, atol=0)
    state, _ = solver.step(state, environment)
    assert state.passed == 0 and state.ends is None
    torch.testing.assert_close((state.positions, state.velocities), (whole.positions, whole.velocities), rtol=0, atol=0)


def test_a_state_continues_as_it_did_whatever_came_between():
    environment, state = falling(0.03)
    solver = LongStepSolver()
    first, _ = solver.step(state, environment)
    second, _ = solver.step(first, environment)
    after = second
    for _ in range(5):
        after, _ = solver.step(after, environment)
    again, _ = solver.step(first, environment)
    torch.testing.assert_close(again.positions, second.positions, rtol=0, atol=0)


def test_no_particle_is_inside_in_any_frame_and_the_water_keeps_its_density():
    environment, state = falling(0.1, speed=3.0)
    solver = LongStepSolver()
    for _ in range(80):
        state, _ = solver.step(state, environment)
        assert environment.distance_and_normal(state.positions)[0].min() > 0
        assert (state.positions > environment.lower).all() and (state.positions < environment.upper).all()
        assert max_density(kd_tree(state.positions.numpy())) < 1.06


def test_before_water_strikes_it_falls_as_by_the_solver():
    environment, state = falling(0.5)
    exact, solver, default = particles(state), LongStepSolver(), DfsphSolver()
    for _ in range(20):
        state, _ = solver.step(state, environment)
        exact, _ = default.step(exact, environment)
    torch.testing.assert_close(state.positions, exact.positions, rtol=0, atol=1e-5)
    torch.testing.assert_close(state.velocities, exact.velocities, rtol=0, atol=1e-4)


def test_free_fall_ends_before_water_reaches_a_solid_or_a_wall():
    environment, state = falling(0.5)
    assert free_fall(particles(state), environment) is not None
    for height in (0.03, 0.0):
        environment, state = falling(height)
        assert free_fall(particles(state), environment) is None
    environment, state = falling(0.5)
    aside = ParticleState(state.positions + torch.tensor([0.4, 0.0, 0.0]), state.velocities)
    assert free_fall(aside, environment) is None


def test_water_that_rests_or_moves_apart_does_not_fall_freely():
    environment, state = falling(0.5, speed=0.0)
    assert free_fall(particles(state), environment) is None
    environment, state = falling(0.5)
    state.velocities[0, 0] += 1.0
    assert free_fall(particles(state), environment) is None


def test_very_fast_water_takes_the_frames_of_the_default_solver():
    environment, state = falling(0.03, speed=20.0)
    end, _ = LongStepSolver().long_step(particles(state), environment)
    exact, solver = particles(state), DfsphSolver()
    for _ in range(4):
        exact, _ = solver.step(exact, environment)
    torch.testing.assert_close(end.positions, exact.positions, rtol=0, atol=0)


def test_a_gradient_is_refused():
    environment, state = falling(0.03)
    state.positions.requires_grad_()
    with pytest.raises(InputError, match="C\\+\\+ code only"):
        LongStepSolver().step(state, environment)
