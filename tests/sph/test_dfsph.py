from itertools import pairwise

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.scene import FRAME_TIME, SPACING, Scene, Shape
from surfsup.sdf import Sphere, Surface
from surfsup.sph.dfsph import DIVERGENCE_RELAXATION
from surfsup.sph.environment import Environment
from surfsup.sph.state import SUBSTEPS, ParticleState
from surfsup.sph.warp_engine.solver import WarpSolver
from surfsup.splishsplash.solver import simulate

NO_GRAVITY = torch.zeros(3, dtype=torch.float64)


def environment_of(surface: Surface | None = None, gravity: torch.Tensor = NO_GRAVITY) -> Environment:
    corner = torch.full((3,), 5.0, dtype=torch.float64)
    return Environment(surface, -corner, corner, gravity)


def deltas(state: ParticleState, environment: Environment) -> tuple[torch.Tensor, torch.Tensor]:
    """Changes of velocity and position against ballistic motion."""
    predicted, falling = state.ballistic(environment.gravity)
    distance, normal = environment.distance_and_normal(predicted)
    positions, velocities = WarpSolver().advance(state, environment, predicted, distance, normal)
    return velocities - falling, positions - predicted


def lattice(side: int) -> torch.Tensor:
    return torch.cartesian_prod(*[SPACING * torch.arange(side, dtype=torch.float64)] * 3)


def disordered(side: int, seed: int = 0, speed: float = 1.0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = lattice(side) + 0.003 * torch.randn(side**3, 3, generator=random, dtype=torch.float64)
    return ParticleState(positions, speed * torch.randn(side**3, 3, generator=random, dtype=torch.float64))


def test_free_fall_is_exact():
    velocities = torch.tensor([0.3, -0.2, -2.0], dtype=torch.float64).expand(64, 3)
    gravity = torch.tensor([0.0, 0.0, -9.81]).double()
    delta_velocity, delta_position = deltas(ParticleState(lattice(4), velocities), environment_of(gravity=gravity))
    assert delta_velocity.abs().max() < 1e-12
    assert delta_position.abs().max() < 1e-12


def test_expanding_water_is_slowed_by_viscosity_alone():
    positions = 1.2 * lattice(3)
    state = ParticleState(positions, 5.0 * (positions - positions.mean(dim=0)))
    delta_velocity, _ = deltas(state, environment_of())
    slowed = -(delta_velocity * state.velocities).sum(dim=-1) / state.velocities.square().sum(dim=-1).clamp(min=1e-9)
    assert (slowed > -1e-12).all()
    assert 0.01 < slowed.max() < 0.3


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.1, 1.0, 4.0]))
def test_momentum_is_conserved_but_for_viscosity(seed, speed):
    delta_velocity, _ = deltas(disordered(4, seed, speed), environment_of())
    assert delta_velocity.abs().max() > 1e-3 * speed
    # Viscosity divides by one particle's density, as in the reference.
    assert delta_velocity.sum(dim=0).norm() < 0.03 * delta_velocity.norm(dim=1).sum()


def test_two_particles_that_meet_lose_their_approach_velocity_and_nothing_else():
    positions = torch.tensor([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]], dtype=torch.float64)
    velocities = torch.tensor([[0.5, 0.2, 0.0], [-0.5, 0.2, 0.0]], dtype=torch.float64)
    delta_velocity, _ = deltas(ParticleState(positions, velocities), environment_of())
    after = velocities + delta_velocity
    assert abs(after[0, 0]) < 0.1 * velocities[0, 0]
    torch.testing.assert_close(after[0, 0], -after[1, 0])
    torch.testing.assert_close(after[:, 1], velocities[:, 1])


@pytest.mark.parametrize("speed", [0.2, 1.0, 3.0])
def test_a_lone_particle_at_a_solid_keeps_what_the_relaxation_leaves_of_its_approach(speed):
    state = ParticleState(
        torch.tensor([[0.0, 0.0, 0.345]], dtype=torch.float64),
        torch.tensor([[0.4, 0.0, -speed]], dtype=torch.float64),
    )
    delta_velocity, delta_position = deltas(state, environment_of(Sphere(0.3).double()))
    remaining = (1 - DIVERGENCE_RELAXATION) ** SUBSTEPS
    assert delta_velocity[0, 2] == pytest.approx(speed * (1 - remaining), rel=0.03)
    assert 0 < delta_position[0, 2] < FRAME_TIME * speed


@pytest.mark.parametrize("seed", range(3))
def test_a_frame_of_a_splash_equals_the_reference_s(seed):
    """Of the squared change of velocity by the reference at most 8 % are missed, at a solid and in corners, too."""
    scene = Scene(
        surface=Shape(sphere={"radius": 0.15}, at=(0.35 * (seed > 0), 0.35 * (seed > 1), 0.2)),
        fluid=[{"block": {"min": (0.1, 0.1, 0.4), "max": (0.45, 0.45, 0.7), "velocity": (0.0, 0.0, -2.0)}}],
        frames=41,
    )
    surface = scene.build_surface()
    environment = Environment.of(scene, surface)
    frames = [
        tuple(map(torch.from_numpy, frame)) for frame in simulate(scene, surface, scene.initial_particles(surface))
    ]
    missed = changed = 0.0
    for (positions, velocities), (_, after) in list(pairwise(frames))[20:]:
        delta_velocity, _ = deltas(ParticleState(positions, velocities), environment)
        falling = velocities + FRAME_TIME * environment.gravity
        missed += (after - falling - delta_velocity).square().sum()
        changed += (after - falling).square().sum()
    assert missed < 0.08 * changed


def test_beyond_the_kernel_support_a_solid_stops_nothing():
    state = ParticleState(torch.tensor([[0.0, 0.0, 0.4]]).double(), torch.tensor([[0.0, 0.0, -3.0]]).double())
    assert not torch.cat(deltas(state, environment_of(Sphere(0.3).double()))).any()


def test_gradients_equal_finite_differences():
    state, environment = disordered(2, seed=3), environment_of(Sphere(0.3).double())
    positions = state.positions + torch.tensor([0.0, 0.0, 0.33], dtype=torch.float64)
    inputs = positions.requires_grad_(), state.velocities.requires_grad_()
    assert torch.autograd.gradcheck(
        lambda x, v: deltas(ParticleState(x, v), environment), inputs, eps=1e-7, atol=1e-3, rtol=1e-3
    )
