import math
import types

import pytest
import torch

from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import (
    ACTIONS,
    DENSITY_SCALE,
    DISPLACEMENT_SCALE,
    SLOPE_SCALE,
    SURROUNDINGS,
    Features,
    observe_features,
)
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator, join_observations
from surfsup.sdf import Sphere, Transformed
from surfsup.sph.boundary.density import flat_share, solid_density
from surfsup.sph.dfsph import sweep
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.state import FRAME_TIME, SOLVER_STEPS, STEP_TIME, Environment, ParticleState

GRAVITY = torch.tensor([0.0, 0.0, -9.81])


def around(surface=None, dtype=torch.float32, gravity=GRAVITY) -> Environment:
    lower, upper = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
    return Environment(surface, lower.to(dtype), upper.to(dtype), gravity.to(dtype))


def model(seed: int = 0, dtype=torch.float32, lively: bool = True, **sizes) -> CorrectedSimulator:
    torch.manual_seed(seed)
    made = CorrectedSimulator(Architecture(**{"width": 8, "layers": 2, **sizes})).to(dtype)
    if lively:  # a decoder that starts small would hide most faults
        torch.nn.init.normal_(made.network.decoder[-1].weight, std=0.5)
    return made


def silent(dtype=torch.float32) -> CorrectedSimulator:
    made = model(dtype=dtype)
    for parameter in made.parameters():
        torch.nn.init.zeros_(parameter)
    return made


def water(count: int = 60, seed: int = 0, dtype=torch.float32, low: float = 1.0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype) * 0.2 + torch.tensor([0, 0, low], dtype=dtype)
    velocities = torch.randn(count, 3, generator=random, dtype=dtype)
    return ParticleState(positions, velocities)


def solver_step(positions: torch.Tensor, velocities: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """One frame of semi-implicit Euler, as the solver falls."""
    for _ in range(SOLVER_STEPS):
        velocities = velocities + STEP_TIME * GRAVITY.double()
        positions = positions + STEP_TIME * velocities
    return positions, velocities


def test_free_fall_is_exact():
    apart = torch.cartesian_prod(*[0.1 * torch.arange(4)] * 3).double() + torch.tensor([0.0, 0.0, 1.0])
    state = ParticleState(apart, 0.1 * water(len(apart), dtype=torch.float64).velocities)
    surroundings = around(Transformed(Sphere(0.1), None, (0.0, 0.0, 0.1)), torch.float64)
    surroundings.surface.double()
    positions, velocities = state.positions, state.velocities
    simulator = silent(torch.float64)
    for _ in range(10):
        state, moved = simulator.step(state, surroundings)
        positions, velocities = solver_step(positions, velocities)
        torch.testing.assert_close(state.positions, positions, atol=1e-12, rtol=0)
        torch.testing.assert_close(state.velocities, velocities, atol=1e-10, rtol=0)
        assert not moved.any()


def test_a_state_in_the_midst_of_a_scene_is_the_one_that_a_rollout_would_begin_at():
    now = water()
    simulator, surroundings = model(), around()
    after = simulator.state_after(now.positions[None], now.velocities[None])
    started = simulator.start(now.positions, now.velocities, surroundings)
    assert simulator.past == 0
    assert all(torch.equal(one, other) for one, other in zip(vars(after).values(), vars(started).values(), strict=True))


def test_an_untrained_model_is_close_to_what_the_sweeps_make():
    state, surroundings, simulator = water(), around(), model(lively=False)
    after, _ = simulator.step(state, surroundings)
    seen = simulator.observe(state, surroundings)
    assert (after.positions - seen.places).abs().max() < 1e-4
    assert (after.velocities - seen.speeds).abs().max() < 0.05


def test_the_order_of_particles_does_not_matter():
    state, surroundings, simulator = (
        water(dtype=torch.float64),
        around(None, torch.float64),
        model(dtype=torch.float64),
    )
    order = torch.randperm(len(state.positions))
    shuffled = ParticleState(*(value[order] for value in vars(state).values()))
    straight, _ = simulator.step(state, surroundings)
    permuted, _ = simulator.step(shuffled, surroundings)
    torch.testing.assert_close(permuted.positions, straight.positions[order])
    torch.testing.assert_close(permuted.velocities, straight.velocities[order])
    assert (straight.positions - simulator.observe(state, surroundings).ahead).abs().max() > 1e-5


def test_far_from_the_walls_only_relative_places_matter():
    simulator, surroundings = model(dtype=torch.float64), around(None, torch.float64)
    state = water(dtype=torch.float64)
    shift = torch.tensor([0.05, -0.1, 0.2], dtype=torch.float64)
    moved = ParticleState(state.positions + shift, state.velocities)
    torch.testing.assert_close(
        simulator.step(moved, surroundings)[0].positions,
        simulator.step(state, surroundings)[0].positions + shift,
    )


def test_what_is_out_of_reach_has_no_influence():
    simulator, surroundings = model(dtype=torch.float64), around(None, torch.float64)
    here, there = water(40, 1, torch.float64, low=0.3), water(25, 2, torch.float64, low=1.5)
    both = ParticleState(*(torch.cat(pair) for pair in zip(vars(here).values(), vars(there).values(), strict=True)))
    together = simulator.step(both, surroundings)[0].positions
    apart = [simulator.step(part, surroundings)[0].positions for part in (here, there)]
    torch.testing.assert_close(together, torch.cat(apart))


def test_scenes_joined_for_one_pass_are_corrected_as_on_their_own():
    simulator = model(dtype=torch.float64)
    sideways = torch.tensor([1.0, 0.0, -5.0])
    places = [around(None, torch.float64), around(Sphere(0.9).double(), torch.float64, sideways)]
    seen = [simulator.observe(water(n, n, torch.float64), place) for n, place in zip((30, 12), places, strict=True)]
    joined = simulator.correct(join_observations(seen))
    alone = [simulator.correct(one) for one in seen]
    torch.testing.assert_close(joined.velocity, torch.cat([one.velocity for one in alone]))
    torch.testing.assert_close(joined.position, torch.cat([one.position for one in alone]))


@pytest.mark.parametrize("count", [1, 2])
def test_a_drop_or_two_can_be_simulated(count):
    state, _ = model().step(water(count), around())
    assert torch.isfinite(state.positions).all()


def test_a_rollout_is_lazy_and_starts_with_the_start():
    simulator, state, surroundings = model(), water(), around(Transformed(Sphere(0.3), None, (0, 0, 0.3)))
    steps = []
    simulator.step = lambda *arguments: steps.append(0) or CorrectedSimulator.step(simulator, *arguments)
    rollout = simulator.rollout(state, surroundings, frames=10**9)
    assert isinstance(rollout, types.GeneratorType)
    first, moved = next(rollout)
    assert first is state
    assert not moved.any()
    assert steps == []
    for expected in (1, 2, 3):
        following, _ = next(rollout)
        assert len(steps) == expected
        assert not following.positions.requires_grad
    assert torch.is_grad_enabled()


def test_a_rollout_has_as_many_frames_as_asked_for_and_repeats_bit_for_bit():
    simulator, surroundings = model(), around()
    runs = [[now.positions for now, _ in simulator.rollout(water(), surroundings, 5)] for _ in range(2)]
    assert len(runs[0]) == 5
    assert all(torch.equal(one, other) for one, other in zip(*runs, strict=True))


def test_the_guard_can_be_left_out():
    surface = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.3))
    state = ParticleState(torch.tensor([[0.0, 0.0, 0.63]]), torch.tensor([[0.0, 0.0, -9.0]]))
    simulator, down = silent(), torch.tensor([[0.0, 0.0, -0.05 / DISPLACEMENT_SCALE]])
    simulator.correct = lambda _seen: Correction(torch.zeros(1, 3), down)
    handle_collisions, moved = simulator.step(state, around(surface))
    assert moved.all() and surface.distance(handle_collisions.positions) > 0
    free, moved = simulator.step(state, around(surface), handle_collisions=False)
    assert not moved.any() and surface.distance(free.positions) < 0


def test_the_gradient_in_a_shape_parameter_is_that_of_finite_differences():
    simulator = model(dtype=torch.float64)
    state = water(15, dtype=torch.float64)

    def height_after_three_frames(radius: torch.Tensor) -> torch.Tensor:
        surroundings = around(Transformed(Sphere(radius), None, (0.1, 0.1, 0.65)).double(), torch.float64)
        now = state
        for _ in range(3):
            now, _ = simulator.step(now, surroundings)
        return now.positions[:, 2].mean()

    # The water is within reach of the ball, some of it in its way, and no particle changes sides in between.
    radius = torch.tensor(0.33, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(height_after_three_frames(radius), radius)
    step = 1e-6
    with torch.no_grad():
        rise = height_after_three_frames(radius + step) - height_after_three_frames(radius - step)
    assert abs(gradient) > 1e-4
    torch.testing.assert_close(gradient, rise / (2 * step), rtol=1e-4, atol=1e-6)


def looked(state: ParticleState, place: Environment) -> tuple:
    """What features and sweeps are made of."""
    ahead = state.ballistic(place.gravity)[0]
    near = find_neighbors(0.5 * (state.positions + ahead), 0.06)
    return state, ahead, *place.distance_and_normal(ahead), place, near, 0.06


def observed(positions: torch.Tensor, velocities: torch.Tensor, place: Environment) -> Features:
    """What the network is told of water at ``positions``."""
    return observe_features(*looked(ParticleState(positions, velocities), place))


def test_what_acts_beside_a_solid_and_how_neighbors_lie_are_the_documented_columns():
    state = ParticleState(
        torch.tensor([[0.0, 0.0, 0.32]]), torch.tensor([[0.0, 0.0, -1e-3]])
    )  # slow enough to stay there
    place = around(Sphere(0.3), gravity=torch.zeros(3))
    told, (_, _, last) = observed(state.positions, state.velocities, place), sweep(*looked(state, place))
    assert (told.acts.shape, told.lie.shape) == ((1, ACTIONS), (1, SURROUNDINGS))
    distance = torch.tensor(0.02)
    solid, fall = (float(value) for value in solid_density(distance, flat_share(distance)))
    slope = fall / 0.06
    expected = torch.zeros(ACTIONS)
    expected[0:3], expected[3:6] = told.faster[0] / 0.3, told.farther[0] / (FRAME_TIME * 0.3)
    expected[8] = -slope / SLOPE_SCALE  # density falls on the way up
    assert 1 / math.pi + solid > 1  # too dense, were it not allowed to be what it is at the start
    speed = float(last.velocities[0, 2])
    assert 5e-5 < speed < 5e-4  # what it had come in by has turned it around
    expected[13] = -speed * slope * FRAME_TIME / DENSITY_SCALE  # how fast density rises in the last step
    torch.testing.assert_close(told.acts[0], expected, atol=2e-3, rtol=1e-3)  # it moves by a micrometer
    torch.testing.assert_close(told.lie[0], torch.tensor([0, 0, 0, 0, 0, solid]), atol=1e-4, rtol=0)


def test_neighbors_are_felt_by_their_velocity_against_the_particle_s_own():
    positions = torch.tensor([[0.0, 0.0, 1.0], [0.03, 0.0, 1.0]])

    def boundary_map(drift):
        return observed(positions, torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.06, 0.0]]) + torch.tensor(drift), around())

    told = boundary_map([0.0, 0.0, 0.0])
    acts, lie = told.acts, told.lie
    # The window at half the radius, 0.06 m/s: across, so that nothing but a little viscosity slows them.
    assert acts[0, 10] == pytest.approx(0.25 * 0.06 / 0.3, rel=0.03)
    assert acts[1, 10] == pytest.approx(-0.25 * 0.06 / 0.3, rel=0.03)
    assert lie[0, 0] == pytest.approx(0.25, abs=1e-3)
    torch.testing.assert_close(boundary_map([5.0, -3.0, 2.0]).acts, acts, atol=1e-4, rtol=0)


def test_any_network_leaves_a_free_fall_alone():
    positions = torch.cartesian_prod(*[torch.arange(5) * 0.03] * 3).double() + torch.tensor([0.0, 0.0, 1.0])
    velocities = torch.tensor([0.5, -0.2, -2.0], dtype=torch.float64).expand_as(positions)
    state = ParticleState(positions, velocities)
    simulator, surroundings = model(dtype=torch.float64), around(dtype=torch.float64)
    for _ in range(10):
        state, _ = simulator.step(state, surroundings)
        positions, velocities = solver_step(positions, velocities)
    torch.testing.assert_close(state.positions, positions, atol=1e-9, rtol=0)
    torch.testing.assert_close(state.velocities, velocities, atol=1e-7, rtol=0)
