import types

import pytest
import torch

from surfsup.sdf import Sphere, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver, finish_step
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS, ParticleState

GRAVITY = torch.tensor([0.0, 0.0, -9.81])


def environment_of(surface=None, dtype: torch.dtype = torch.float32) -> Environment:
    lower, upper = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
    return Environment(surface, lower.to(dtype), upper.to(dtype), GRAVITY.to(dtype))


def water(count: int = 60, seed: int = 0, dtype: torch.dtype = torch.float32, low: float = 1.0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype) * 0.2 + torch.tensor([0, 0, low], dtype=dtype)
    return ParticleState(positions, torch.randn(count, 3, generator=random, dtype=dtype))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_free_fall_is_exact(dtype):
    apart = torch.cartesian_prod(*[0.1 * torch.arange(4)] * 3).to(dtype) + torch.tensor([0.0, 0.0, 1.0])
    state = ParticleState(apart, 0.1 * water(len(apart), dtype=dtype).velocities)
    environment = environment_of(Transformed(Sphere(0.1), None, (0.0, 0.0, 0.1)).to(dtype), dtype)
    positions, velocities = state.positions.double(), state.velocities.double()
    tolerance = 1e-12 if dtype == torch.float64 else 2e-6
    for _ in range(10):
        state, collided = DfsphSolver().step(state, environment)
        for _ in range(SUBSTEPS):
            velocities = velocities + SUBSTEP_TIME * GRAVITY.double()
            positions = positions + SUBSTEP_TIME * velocities
        torch.testing.assert_close(state.positions.double(), positions, atol=tolerance, rtol=0)
        torch.testing.assert_close(state.velocities.double(), velocities, atol=100 * tolerance, rtol=0)
        assert not collided.any()


def test_a_state_from_a_frame_is_the_state_of_a_rollout():
    now, solver = water(), DfsphSolver()
    from_frame = solver.state_from_frames(now.positions[None], now.velocities[None])
    initial = solver.initial_state(now.positions, now.velocities, environment_of())
    assert solver.history_length == 0
    for one, other in zip(vars(from_frame).values(), vars(initial).values(), strict=True):
        assert torch.equal(one, other)


def test_far_from_walls_only_relative_positions_matter():
    environment, state = environment_of(None, torch.float64), water(dtype=torch.float64)
    shift = torch.tensor([0.05, -0.1, 0.2], dtype=torch.float64)
    shifted, _ = DfsphSolver().step(ParticleState(state.positions + shift, state.velocities), environment)
    straight, _ = DfsphSolver().step(state, environment)
    torch.testing.assert_close(shifted.positions, straight.positions + shift)


def test_distant_water_has_no_influence():
    environment = environment_of(None, torch.float64)
    here, there = water(40, 1, torch.float64, low=0.3), water(25, 2, torch.float64, low=1.5)
    both = ParticleState(*(torch.cat(pair) for pair in zip(vars(here).values(), vars(there).values(), strict=True)))
    together = DfsphSolver().observe(both, environment).positions
    alone = [DfsphSolver().observe(part, environment).positions for part in (here, there)]
    torch.testing.assert_close(together, torch.cat(alone))


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_particles_can_be_simulated(count):
    state, _ = DfsphSolver().step(water(count), environment_of())
    assert torch.isfinite(state.positions).all()


def test_a_rollout_is_lazy_and_begins_with_the_given_state(monkeypatch):
    solver, state, environment = DfsphSolver(), water(), environment_of(Transformed(Sphere(0.3), None, (0, 0, 0.3)))
    steps = []
    monkeypatch.setattr(solver, "step", lambda *args: steps.append(0) or DfsphSolver.step(solver, *args))
    rollout = solver.rollout(state, environment, frames=10**9)
    assert isinstance(rollout, types.GeneratorType)
    first, collided = next(rollout)
    assert first is state
    assert not collided.any()
    assert steps == []
    for expected in (1, 2, 3):
        next(rollout)
        assert len(steps) == expected
    assert torch.is_grad_enabled()


def test_a_rollout_has_the_given_number_of_frames_and_repeats_bit_for_bit():
    runs = [[now.positions for now, _ in DfsphSolver().rollout(water(), environment_of(), 5)] for _ in range(2)]
    assert len(runs[0]) == 5
    assert all(torch.equal(one, other) for one, other in zip(*runs, strict=True))


def test_collision_handling_can_be_left_out():
    surface = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.3))
    state = ParticleState(torch.tensor([[0.0, 0.0, 0.63]]), torch.tensor([[0.0, 0.0, -9.0]]))
    positions, velocities = torch.tensor([[0.0, 0.0, 0.58]]), torch.tensor([[0.0, 0.0, -9.0]])
    step = (state, positions, velocities, environment_of(surface), None)
    handled, collided = finish_step(*step, handle_collisions=True)
    assert collided.all() and surface.distance(handled.positions) > 0
    unhandled, collided = finish_step(*step, handle_collisions=False)
    assert not collided.any() and surface.distance(unhandled.positions) < 0


def test_the_gradient_of_three_frames_in_a_shape_parameter_equals_finite_differences():
    solver, state = DfsphSolver(), water(15, dtype=torch.float64)

    def height_after_three_frames(radius: torch.Tensor) -> torch.Tensor:
        environment = environment_of(Transformed(Sphere(radius), None, (0.1, 0.1, 0.65)).double(), torch.float64)
        now = state
        for _ in range(3):
            now, _ = solver.step(now, environment)
        return now.positions[:, 2].mean()

    # The ball is within the kernel support of some particles and collides with others, at any of the radii.
    radius = torch.tensor(0.33, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(height_after_three_frames(radius), radius)
    step = 1e-6
    with torch.no_grad():
        difference = height_after_three_frames(radius + step) - height_after_three_frames(radius - step)
    assert abs(gradient) > 1e-4
    torch.testing.assert_close(gradient, difference / (2 * step), rtol=1e-4, atol=1e-6)
