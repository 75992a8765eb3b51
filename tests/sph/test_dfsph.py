from itertools import pairwise

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.scene import SPACING, Scene, Shape
from surfsup.sdf import Sphere, Surface
from surfsup.sph.dfsph import OF_RISE, SLOW, fast, sweep
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.state import FRAME_TIME, SOLVER_STEPS, Environment, ParticleState
from surfsup.splishsplash.solver import simulate

RADIUS = KERNEL_SUPPORT
NO_GRAVITY = torch.zeros(3, dtype=torch.float64)


def around(surface: Surface | None = None, gravity: torch.Tensor = NO_GRAVITY) -> Environment:
    corner = torch.full((3,), 5.0, dtype=torch.float64)
    return Environment(surface, -corner, corner, gravity)


def swept(state: ParticleState, place: Environment) -> tuple[torch.Tensor, torch.Tensor]:
    """What is added to velocities and places."""
    ahead = state.ballistic(place.gravity)[0]
    distance, normal = place.distance_and_normal(ahead)
    near = find_neighbors(0.5 * (state.positions + ahead), RADIUS)
    return sweep(state, ahead, distance, normal, place, near, RADIUS)[:2]


def lattice(side: int) -> torch.Tensor:
    return torch.cartesian_prod(*[SPACING * torch.arange(side, dtype=torch.float64)] * 3)


def stirred(side: int, seed: int = 0, speed: float = 1.0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    places = lattice(side) + 0.003 * torch.randn(side**3, 3, generator=random, dtype=torch.float64)
    return ParticleState(places, speed * torch.randn(side**3, 3, generator=random, dtype=torch.float64))


def test_a_free_fall_stays_one_exactly():
    velocities = torch.tensor([0.3, -0.2, -2.0], dtype=torch.float64).expand(64, 3)
    faster, farther = swept(
        ParticleState(lattice(4), velocities), around(gravity=torch.tensor([0.0, 0.0, -9.81]).double())
    )
    assert faster.abs().max() < 1e-12
    assert farther.abs().max() < 1e-12


def test_what_flies_apart_is_slowed_by_viscosity_alone():
    places = 1.2 * lattice(3)
    state = ParticleState(places, 5.0 * (places - places.mean(dim=0)))
    faster, _ = swept(state, around())
    slowed = -(faster * state.velocities).sum(dim=-1) / state.velocities.square().sum(dim=-1).clamp(min=1e-9)
    assert (slowed > -1e-12).all()
    assert 0.01 < slowed.max() < 0.3


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.1, 1.0, 4.0]))
def test_particles_push_each_other_equally(seed, speed):
    faster, _ = swept(stirred(4, seed, speed), around())
    assert faster.abs().max() > 1e-3 * speed
    # But for viscosity, which the solver divides by the neighbor's density alone.
    assert faster.sum(dim=0).norm() < 0.03 * faster.norm(dim=1).sum()


def test_two_that_meet_lose_the_velocity_at_which_they_do_and_nothing_else():
    places = torch.tensor([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]], dtype=torch.float64)
    velocities = torch.tensor([[0.5, 0.2, 0.0], [-0.5, 0.2, 0.0]], dtype=torch.float64)
    faster, _ = swept(ParticleState(places, velocities), around())
    after = velocities + faster
    assert abs(after[0, 0]) < 0.1 * velocities[0, 0]
    torch.testing.assert_close(after[0, 0], -after[1, 0])
    torch.testing.assert_close(after[:, 1], velocities[:, 1])  # not that across


@pytest.mark.parametrize("speed", [0.2, 1.0, 3.0])
def test_a_particle_alone_at_a_solid_keeps_only_what_sweeps_leave_of_its_way_in(speed):
    state = ParticleState(
        torch.tensor([[0.0, 0.0, 0.345]], dtype=torch.float64),
        torch.tensor([[0.4, 0.0, -speed]], dtype=torch.float64),
    )
    faster, farther = swept(state, around(Sphere(0.3).double()))
    left = (1 - OF_RISE) ** SOLVER_STEPS
    assert faster[0, 2] == pytest.approx(speed * (1 - left), rel=0.03)
    assert 0 < farther[0, 2] < FRAME_TIME * speed


@pytest.mark.parametrize("seed", range(3))
def test_it_is_what_the_solver_does(seed):
    """Of what the solver changes in a frame of a splash little is left over, at a solid and in corners too."""
    scene = Scene(
        surface=Shape(sphere={"radius": 0.15}, at=(0.35 * (seed > 0), 0.35 * (seed > 1), 0.2)),
        fluid=[{"block": {"min": (0.1, 0.1, 0.4), "max": (0.45, 0.45, 0.7), "velocity": (0.0, 0.0, -2.0)}}],
        frames=41,
    )
    surface = scene.build_surface()
    place = Environment.of(scene, surface)
    frames = [
        tuple(map(torch.from_numpy, frame)) for frame in simulate(scene, surface, scene.initial_particles(surface))
    ]
    left = changed = 0.0
    for (positions, velocities), (_, after) in list(pairwise(frames))[20:]:
        faster, _ = swept(ParticleState(positions, velocities), place)
        falling = velocities + FRAME_TIME * place.gravity
        left += (after - falling - faster).square().sum()
        changed += (after - falling).square().sum()
    assert left < 0.08 * changed


def test_a_slow_rise_is_not_reckoned_with_in_advance_and_of_a_fast_one_only_what_is_more():
    rises = torch.tensor([-3 * SLOW, -SLOW, -0.5 * SLOW, 0.0, 0.5 * SLOW, SLOW, 1.5 * SLOW, 40.0])
    torch.testing.assert_close(fast(rises), torch.tensor([-2 * SLOW, 0, 0, 0, 0, 0, 0.5 * SLOW, 40.0 - SLOW]))


def test_beyond_its_reach_a_solid_stops_nothing():
    state = ParticleState(torch.tensor([[0.0, 0.0, 0.4]]).double(), torch.tensor([[0.0, 0.0, -3.0]]).double())
    assert not torch.cat(swept(state, around(Sphere(0.3).double()))).any()


def test_they_have_the_gradients_of_finite_differences():
    state = stirred(2, seed=3)
    place = around(Sphere(0.3).double())
    places = state.positions + torch.tensor([0.0, 0.0, 0.33], dtype=torch.float64)
    inputs = places.requires_grad_(), state.velocities.requires_grad_()
    assert torch.autograd.gradcheck(
        lambda x, v: swept(ParticleState(x, v), place), inputs, eps=1e-7, atol=1e-3, rtol=1e-3
    )
