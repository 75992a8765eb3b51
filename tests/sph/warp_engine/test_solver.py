from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.errors import InputError, SimulationError
from surfsup.native.dispatch import is_built
from surfsup.scene import SPACING, Container
from surfsup.sdf import Heightfield, MeshSurface, Sphere, Surface, Transformed, fit_surface, load_siren
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.energy import MAX_ENERGY_GAIN, energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from surfsup.sph.warp_engine import neighbors
from surfsup.sph.warp_engine.solver import WarpSolver
from tests.sph.warp_engine import dense_solver

needs_cpp = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")

LOWER, UPPER = (-0.5, -0.5, 0.0), (0.5, 0.5, 2.0)
GRAVITY = (0.0, 0.0, -9.81)
BALL = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.3))
QUARTER_TURN = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def environment_of(surface: Surface | None, with_map: bool = True, dtype: torch.dtype = torch.float32) -> Environment:
    boundary_map = BoundaryMap.of(surface, Container()) if surface is not None and with_map else None
    vectors = (torch.tensor(value, dtype=dtype) for value in (LOWER, UPPER, GRAVITY))
    return Environment(surface, *vectors, boundary_map)


def splash(count: int, seed: int = 0, low: float = 0.62, dtype: torch.dtype = torch.float64) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype) * 0.2 + torch.tensor([0, 0, low], dtype=dtype)
    return ParticleState(positions, torch.randn(count, 3, generator=random, dtype=dtype))


def advanced(
    state: ParticleState,
    environment: Environment,
    distance: torch.Tensor | None = None,
    normal: torch.Tensor | None = None,
) -> tuple[torch.Tensor, torch.Tensor]:
    predicted, _ = state.ballistic(environment.gravity)
    if distance is None or normal is None:
        distance, normal = environment.distance_and_normal(predicted)
    return WarpSolver().advance(state, environment, predicted, distance, normal)


def impact(dtype: torch.dtype = torch.float64) -> ParticleState:
    """Particles of which some strike the ball within the frame."""
    state = splash(150, low=0.56, dtype=dtype)
    distance, normal = BALL.distance_and_normal(state.positions)
    return ParticleState(
        state.positions + (0.021 - distance).clamp(min=0)[:, None] * normal,
        state.velocities + torch.tensor([0, 0, -8], dtype=dtype),
    )


def falling_block(bottom: float) -> ParticleState:
    """343 particles at 2 m/s, from a height in meters on."""
    grid = torch.cartesian_prod(*[torch.arange(7) * SPACING] * 3) + torch.tensor([-0.1, -0.1, bottom])
    return ParticleState(grid, torch.tensor([0.0, 0.0, -2.0]).expand_as(grid).contiguous())


def solid(name: str) -> Surface:
    if name == "heightfield":
        axis = np.linspace(0, 6, 32)
        return Heightfield(np.sin(axis)[:, None] * np.cos(axis), (1.0, 1.0), 0.1, 0.2)
    return Transformed(
        {
            "ball": lambda: Sphere(0.3),
            "mesh": lambda: MeshSurface(Sphere(0.3).to_mesh(24), cells=24),
            "network": lambda: fit_surface(load_siren(Path("coral")), 0.6),
        }[name](),
        None,
        (0.0, 0.0, 0.3),
    )


@pytest.mark.parametrize("place", ["no solid", "map", "plane", "corner", "inside a solid"])
@settings(max_examples=5)
@given(seed=st.integers(0, 2**32 - 1), speed=st.sampled_from([0.1, 1.0, 4.0]))
def test_a_frame_and_its_gradients_equal_those_of_a_sum_over_all_pairs(place, seed, speed):
    state = splash(120, seed, low=0.5 if place == "inside a solid" else 0.61)
    shift = torch.tensor([-0.5, -0.5, -0.6], dtype=torch.float64) * (place == "corner")
    surface = BALL if place in ("map", "plane", "inside a solid") else None
    environment = environment_of(surface, place != "plane", torch.float64)
    inputs = [(state.positions + shift).requires_grad_(), (speed * state.velocities).requires_grad_()]
    predicted, _ = ParticleState(*inputs).ballistic(environment.gravity)
    inputs += [value.detach().requires_grad_() for value in environment.distance_and_normal(predicted)]
    weights = torch.randn(2, 120, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    results = []
    for advance in (dense_solver.advance, advanced):
        ends = advance(ParticleState(*inputs[:2]), environment, *inputs[2:])
        total = (weights * torch.stack(ends)).sum()
        results.append((ends, torch.autograd.grad(total, inputs, allow_unused=True)))
    for found, expected in zip(results[1][0], results[0][0], strict=True):
        torch.testing.assert_close(found, expected, atol=1e-10, rtol=0)
    for found, expected in zip(results[1][1], results[0][1], strict=True):
        if expected is not None:
            found = torch.zeros_like(expected) if found is None else found
            torch.testing.assert_close(found, expected, atol=1e-8 * float(1 + expected.abs().max()), rtol=0)


@needs_cpp
@pytest.mark.parametrize("with_map", [True, False])
@pytest.mark.parametrize("name", ["ball", "mesh", "heightfield", "network"])
def test_each_of_fifty_frames_of_an_impact_equals_the_one_in_cpp(name, with_map):
    surface = solid(name)
    bottom = 0.32 if name == "heightfield" else 0.63
    state = falling_block(bottom)
    environment, in_cpp, in_warp = environment_of(surface, with_map), DfsphSolver(), DfsphSolver()
    in_warp.native = None
    with torch.no_grad():
        for _ in range(50):
            expected, _ = in_cpp.step(state, environment)
            found, _ = in_warp.step(state, environment)
            torch.testing.assert_close(found.positions, expected.positions, atol=1e-6, rtol=0)
            torch.testing.assert_close(found.velocities, expected.velocities, atol=1e-3, rtol=0)
            state = expected


@needs_cpp
def test_a_rollout_of_twenty_frames_stays_within_ten_micrometers_of_cpp():
    grid = torch.cartesian_prod(*[torch.arange(8) * SPACING] * 3) + torch.tensor([-0.1, -0.1, 0.64])
    state = ParticleState(grid, torch.tensor([0.0, 0.0, -0.5]).expand_as(grid).contiguous())
    in_warp = DfsphSolver()
    in_warp.native = None
    *_, (expected, _) = DfsphSolver().rollout(state, environment_of(BALL), 21)
    *_, (found, _) = in_warp.rollout(state, environment_of(BALL), 21)
    assert (expected.positions - state.positions).abs().max() > 0.05
    assert (found.positions - expected.positions).abs().max() < 1e-5


@needs_cpp
@pytest.mark.parametrize("handle_collisions", [True, False])
def test_walls_and_collisions_equal_those_in_cpp(handle_collisions):
    state = impact(torch.float32)
    shifted = ParticleState(state.positions + torch.tensor([-0.49, 0.0, 0.3]), state.velocities)
    for start, surface in ((state, BALL), (shifted, None)):
        environment, in_warp = environment_of(surface), DfsphSolver()
        in_warp.native = None
        expected, collided = DfsphSolver().step(start, environment, handle_collisions)
        found, also_collided = in_warp.step(start, environment, handle_collisions)
        assert torch.equal(collided, also_collided) and bool(collided.any()) == handle_collisions
        torch.testing.assert_close(found.positions, expected.positions, atol=1e-6, rtol=0)
        torch.testing.assert_close(found.velocities, expected.velocities, atol=1e-3, rtol=0)


def test_a_fixed_list_of_particles_near_the_solid_gives_the_same_as_one_that_is_counted():
    state = impact()
    for with_map in (True, False):
        environment, fixed = environment_of(BALL, with_map, torch.float64), WarpSolver()
        fixed.room.rows = 120
        for one, other in zip(fixed.step(state, environment), WarpSolver().step(state, environment), strict=True):
            assert torch.equal(one, other)


def test_single_precision_equals_double_precision():
    state = splash(300)
    single = ParticleState(state.positions.float(), state.velocities.float())
    positions, velocities = advanced(state, environment_of(BALL, dtype=torch.float64))
    found = advanced(single, environment_of(BALL))
    torch.testing.assert_close(found[0].double(), positions, atol=1e-6, rtol=0)
    torch.testing.assert_close(found[1].double(), velocities, atol=1e-4, rtol=0)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_particles_does_not_matter(seed):
    state, environment = splash(200, seed), environment_of(BALL, dtype=torch.float64)
    order = torch.randperm(200, generator=torch.Generator().manual_seed(seed))
    positions, _ = advanced(state, environment)
    shuffled, _ = advanced(ParticleState(state.positions[order], state.velocities[order]), environment)
    torch.testing.assert_close(shuffled, positions[order])


def test_a_frame_with_gradients_is_the_same_frame():
    state, environment = splash(200), environment_of(BALL, False, torch.float64)
    expected = advanced(state, environment)
    found = advanced(ParticleState(state.positions.requires_grad_(), state.velocities), environment)
    assert all(value.requires_grad for value in found)
    assert all(torch.equal(one, other) for one, other in zip(found, expected, strict=True))


def test_no_particle_stays_no_particle():
    empty = ParticleState(torch.zeros(0, 3), torch.zeros(0, 3))
    state, collided = DfsphSolver().step(empty, environment_of(BALL))
    assert state.positions.shape == (0, 3) and collided.shape == (0,)
    in_warp = DfsphSolver()
    in_warp.native = None
    assert in_warp.observe(empty, environment_of(BALL)).positions.shape == (0, 3)
    assert in_warp.step(empty, environment_of(BALL))[0].positions.shape == (0, 3)


@pytest.mark.parametrize("grid", [(4, 16, 4), neighbors.LARGE_GRID])
def test_the_grid_of_the_search_does_not_matter(grid, monkeypatch):
    state, environment = splash(400), environment_of(None, dtype=torch.float64)
    state = ParticleState(state.positions * torch.tensor([3.0, 3.0, 1.0]), state.velocities)
    expected, _ = advanced(state, environment)
    monkeypatch.setattr(neighbors, "SMALL_GRID", grid)
    found, _ = advanced(state, environment)
    torch.testing.assert_close(found, expected, atol=1e-12, rtol=0)


@pytest.mark.parametrize("with_map", [True, False])
@pytest.mark.parametrize("with_gradient", [True, False])
def test_a_frame_that_lacked_room_is_repeated_with_more(with_map, with_gradient):
    state, environment = impact(), environment_of(BALL, with_map, torch.float64)
    state.positions.requires_grad_(with_gradient)
    expected = WarpSolver().step(state, environment)
    assert expected[2].sum() > 3
    solver = WarpSolver()
    solver.room.neighbors, solver.room.rows = 4, 2
    for _ in range(2):
        found = solver.step(state, environment)
        assert all(torch.equal(one, other) for one, other in zip(found, expected, strict=True))
    assert solver.room.neighbors > 4 and solver.room.rows == len(state.positions)


def test_a_collapse_is_refused():
    positions = 0.01 * torch.rand(3000, 3)
    with pytest.raises(SimulationError, match="the simulation collapsed"):
        advanced(ParticleState(positions, torch.zeros_like(positions)), environment_of(None))


@pytest.mark.parametrize("broken", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["positions", "velocities"])
def test_a_state_that_is_not_finite_is_refused(name, broken):
    state = splash(60)
    getattr(state, name)[3, 1] = broken
    with pytest.raises(SimulationError, match="not a finite number"):
        advanced(state, environment_of(None, dtype=torch.float64))


def test_a_distance_of_nan_affects_only_the_particles_near_it():
    near, far = splash(60), splash(60, 1, low=1.5)
    state = ParticleState(torch.cat([near.positions, far.positions]), torch.cat([near.velocities, far.velocities]))
    environment = environment_of(BALL, False, torch.float64)
    distance, normal = environment.distance_and_normal(state.ballistic(environment.gravity)[0])
    expected, _ = advanced(state, environment, distance, normal)
    positions, _ = advanced(state, environment, distance.index_fill(0, torch.tensor([3]), float("nan")), normal)
    assert not torch.isfinite(positions[3]).all()
    assert torch.equal(positions[60:], expected[60:])


def test_a_precision_that_the_solver_lacks_is_refused():
    state = splash(5, dtype=torch.float16)
    with pytest.raises(InputError, match="float32 or float64, not in float16"):
        WarpSolver().advance(state, environment_of(None, dtype=torch.float16), state.positions, *state.positions.T[:2])


class TestGradients:
    """Against central differences in double precision."""

    def check(self, state: ParticleState, environment: Environment, frames: int = 1, whole: bool = False) -> None:
        solver = WarpSolver()
        weights = torch.randn(2, len(state.positions), 3, generator=torch.Generator().manual_seed(5)).double()

        def total(positions: torch.Tensor, velocities: torch.Tensor) -> torch.Tensor:
            now = ParticleState(positions, velocities)
            for _ in range(frames):
                now = ParticleState(*(solver.step(now, environment)[:2] if whole else advanced(now, environment)))
            return (weights[0] * now.positions).sum() + 0.1 * (weights[1] * now.velocities).sum()

        inputs = [value.clone().requires_grad_() for value in (state.positions, state.velocities)]
        found = torch.autograd.grad(total(*inputs), inputs)
        for seed in range(4):
            random = torch.Generator().manual_seed(seed)
            along = [torch.randn(value.shape, generator=random).double() for value in inputs]
            step = 1e-7
            with torch.no_grad():
                ends = [
                    total(*(value + sign * step * part for value, part in zip(inputs, along, strict=True)))
                    for sign in (1, -1)
                ]
            difference = float(ends[0] - ends[1]) / (2 * step)
            product = float(sum((one * part).sum() for one, part in zip(found, along, strict=True)))
            assert product == pytest.approx(difference, rel=2e-5, abs=1e-5)

    @pytest.mark.parametrize("place", ["no solid", "map", "rotated map", "plane", "floor", "corner"])
    def test_in_positions_and_velocities(self, place):
        state = splash(150)
        environment = {
            "no solid": lambda: environment_of(None, dtype=torch.float64),
            "map": lambda: environment_of(BALL, True, torch.float64),
            "rotated map": lambda: environment_of(
                Transformed(Sphere(0.29), None, (0.05, 0.0, 0.3)), True, torch.float64
            ).transformed_by(QUARTER_TURN.double()),
            "plane": lambda: environment_of(BALL, False, torch.float64),
            "floor": lambda: environment_of(None, dtype=torch.float64),
            "corner": lambda: environment_of(None, dtype=torch.float64),
        }[place]()
        down = {"floor": (0.0, 0.0, -0.61), "corner": (-0.49, -0.49, -0.61)}.get(place, (0.0, 0.0, 0.0))
        shifted = state.positions + torch.tensor(down, dtype=torch.float64)
        if environment.surface is not None:
            assert (environment.surface.distance(shifted) < KERNEL_SUPPORT).any()
        self.check(ParticleState(shifted, state.velocities), environment)

    def test_where_particles_enter_and_leave_the_kernel_support(self):
        state, environment = splash(60, 3), environment_of(BALL, False, torch.float64)
        state = ParticleState(state.positions, 4 * state.velocities)
        after, _ = advanced(state, environment)
        middle = 0.5 * (state.positions + state.ballistic(environment.gravity)[0])
        listed, before, later = (
            torch.cdist(points, points) < KERNEL_SUPPORT for points in (middle, state.positions, after)
        )
        assert (listed & before & ~later).sum() > 10
        assert (listed & ~before & later).sum() > 10
        self.check(state, environment)
        self.check(state, environment, frames=3)

    @pytest.mark.parametrize("with_map", [True, False])
    def test_of_a_whole_frame_in_which_particles_strike_the_solid(self, with_map):
        state, environment = impact(), environment_of(BALL, with_map, torch.float64)
        assert WarpSolver().step(state, environment)[2].sum() > 3
        self.check(state, environment, whole=True)
        self.check(state, environment, frames=3, whole=True)

    def test_of_a_whole_frame_in_which_particles_strike_walls(self):
        state = splash(150)
        state = ParticleState(state.positions + torch.tensor([-0.5, -0.5, -0.61]), state.velocities)
        assert WarpSolver().step(state, environment_of(None, dtype=torch.float64))[2].sum() > 3
        self.check(state, environment_of(None, dtype=torch.float64), whole=True)

    def test_of_a_whole_frame_that_the_energy_limiter_bounds(self):
        state, environment = splash(150), environment_of(BALL, False, torch.float64)
        state = ParticleState(0.6 * state.positions + torch.tensor([0.0, 0.0, 0.35]), 0.5 * state.velocities)
        unlimited = advanced(state, environment)
        assert energy_gain(state, *unlimited, environment.gravity) > MAX_ENERGY_GAIN
        limited = WarpSolver().step(state, environment)
        assert -0.1 < energy_gain(state, *limited[:2], environment.gravity) <= MAX_ENERGY_GAIN
        self.check(state, environment, whole=True)

    def test_of_a_whole_frame_in_the_radius_of_a_ball(self):
        state = impact()

        def end(radius: torch.Tensor) -> torch.Tensor:
            ball = Transformed(Sphere(radius), None, (0.0, 0.0, 0.3))
            positions, velocities, _ = WarpSolver().step(state, environment_of(ball, False, torch.float64))
            return torch.stack([positions.square().sum(), velocities.square().sum()])

        radius = torch.tensor(0.3, dtype=torch.float64, requires_grad=True)
        assert torch.autograd.gradcheck(end, radius, eps=1e-8, atol=1e-4, rtol=1e-4)

    def test_in_distances_and_normals(self):
        state, environment = splash(30, low=0.58), environment_of(BALL, False, torch.float64)
        predicted, _ = state.ballistic(environment.gravity)
        distance, normal = (value.requires_grad_() for value in BALL.distance_and_normal(predicted))
        assert (distance < KERNEL_SUPPORT).sum() > 3
        assert torch.autograd.gradcheck(
            lambda d, n: advanced(state, environment, d, n), (distance, normal), eps=1e-7, atol=1e-5, rtol=1e-4
        )

    def test_are_finite_where_particles_meet(self):
        positions = splash(1).positions.repeat(5, 1).requires_grad_()
        after, _ = advanced(
            ParticleState(positions, torch.zeros_like(positions)), environment_of(BALL, dtype=torch.float64)
        )
        (gradient,) = torch.autograd.grad(after.sum(), positions)
        assert torch.isfinite(gradient).all()

    def test_reach_the_parameters_of_a_network(self):
        siren = fit_surface(load_siren(Path("coral")), 0.6)
        surface = Transformed(siren, None, (0.0, 0.0, 0.3))
        parameters = [value for value in surface.parameters() if value.is_floating_point()]
        for value in parameters:
            value.requires_grad_()
        positions = torch.rand(4000, 3, generator=torch.Generator().manual_seed(1)) * 0.8 - torch.tensor(
            [0.4, 0.4, 0.0]
        )
        with torch.no_grad():
            distance = surface.distance(positions)
        positions = positions[(distance > 0.02) & (distance < 0.05)][:200]
        after, _ = advanced(ParticleState(positions, torch.zeros_like(positions)), environment_of(surface, False))
        gradients = torch.autograd.grad(after[:, 2].mean(), parameters, allow_unused=True)
        found = [gradient for gradient in gradients if gradient is not None]
        assert found and all(torch.isfinite(gradient).all() for gradient in found)
        assert any(gradient.abs().max() > 0 for gradient in found)
