import copy
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.errors import SimulationError
from surfsup.native.dispatch import is_built
from surfsup.scene import FRAME_TIME, Container
from surfsup.sdf import Box, MeshSurface, Sphere, Surface, Transformed, fit_surface, load_siren
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.collision import CLEARANCE, resolve_collisions
from surfsup.sph.energy import MAX_ENERGY_GAIN, energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.native_solver import NativeSolver, solver_parameters
from surfsup.sph.solver import DfsphSolver, can_step_native
from surfsup.sph.state import ParticleState

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")

GRAVITY = torch.tensor([0.0, 0.0, -9.81])
BALL = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.3))
QUARTER_TURN = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
BOUNDS = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
every_isa = pytest.mark.parametrize("isa", native.instruction_sets())

Motion = tuple[torch.Tensor, torch.Tensor]


def environment_of(surface: Surface | None = None, gravity: torch.Tensor = GRAVITY) -> Environment:
    boundary_map = None if surface is None else BoundaryMap.of(surface, Container())
    return Environment(surface, *BOUNDS, gravity, boundary_map)


def splash(count: int, seed: int = 0, low: float = 0.62, side: float = 0.2) -> ParticleState:
    """Particles in a cube with random positions and velocities, more disordered than after any impact."""
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random) * side + torch.tensor([0.0, 0.0, low])
    return ParticleState(positions, torch.randn(count, 3, generator=random))


def shifted(state: ParticleState, *by: float) -> ParticleState:
    return replace(state, positions=state.positions + torch.tensor(by))


def joined(*states: ParticleState) -> ParticleState:
    return ParticleState(*(torch.cat(values) for values in zip(*(vars(s).values() for s in states), strict=True)))


def warp_solver() -> DfsphSolver:
    solver = DfsphSolver()
    solver.native = None
    return solver


def by_warp(state: ParticleState, environment: Environment) -> Motion:
    observation = warp_solver().observe(state, environment)
    return observation.positions, observation.velocities


def by_native(state: ParticleState, environment: Environment, isa: str) -> Motion:
    frame = NativeSolver(isa).step(state, environment, handle_collisions=False)
    return frame.positions, frame.velocities


def assert_equals_warp(motion: Motion, state: ParticleState, environment: Environment) -> None:
    """Equal within 1e-8 m of displacement per frame, relative to its size, and the rounding of positions."""
    positions, velocities = by_warp(state, environment)
    size = 1 + float((velocities - state.velocities).abs().max()) * FRAME_TIME / 1e-4
    torch.testing.assert_close(motion[1] * FRAME_TIME, velocities * FRAME_TIME, atol=1e-8 * size, rtol=2e-7)
    torch.testing.assert_close(motion[0], positions, atol=1e-8 * size + 1.2e-7, rtol=2e-7)


@every_isa
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 400), side=st.floats(0.08, 1.0))
@settings(max_examples=20)
def test_it_equals_warp_on_random_states_beside_a_solid(isa, seed, count, side):
    state, environment = splash(count, seed, side=side), environment_of(BALL)
    assert_equals_warp(by_native(state, environment, isa), state, environment)


@every_isa
@pytest.mark.parametrize(
    "place",
    ["no solid", "floor", "corner", "tilted gravity", "solid without a map", "rotated solid", "inside a solid"],
)
def test_it_equals_warp_in_every_environment(isa, place):
    state, environment = {
        "no solid": (splash(300), environment_of()),
        "floor": (splash(300, low=0.02), environment_of()),
        "corner": (shifted(splash(300), -0.52, -0.52, -0.65), environment_of()),
        "tilted gravity": (splash(300), environment_of(BALL, torch.tensor([3.0, 0.0, -5.0]))),
        "solid without a map": (splash(300), replace(environment_of(BALL), boundary_map=None)),
        "rotated solid": (splash(300), environment_of(BALL).transformed_by(QUARTER_TURN)),
        "inside a solid": (
            splash(300, low=0.3),
            environment_of(Transformed(Box((0.4, 0.4, 0.4)), None, (0.0, 0.0, 0.4))),
        ),
    }[place]
    assert_equals_warp(by_native(state, environment, isa), state, environment)


@every_isa
@pytest.mark.parametrize("count", [0, 1, 2])
def test_no_particle_one_and_two_particles(isa, count):
    state, environment = splash(count, side=0.02), environment_of(BALL)
    positions, velocities = by_native(state, environment, isa)
    assert positions.shape == velocities.shape == (count, 3)
    if count:
        assert_equals_warp((positions, velocities), state, environment)


@every_isa
def test_the_recorded_substep_equals_warp(isa):
    state, environment = splash(300), environment_of(BALL)
    frame, substep = NativeSolver(isa).observe(state, environment)
    expected = warp_solver().observe(state, environment)
    assert_equals_warp((frame.positions, frame.velocities), state, environment)
    for name, value in vars(substep).items():
        if name != "graph":
            reference = getattr(expected.substep, name)
            atol = 2e-5 * float(1 + reference.abs().max())
            torch.testing.assert_close(value, reference, atol=atol, rtol=1e-4, msg=lambda m, name=name: f"{name}: {m}")
    torch.testing.assert_close(substep.graph.kernels, expected.substep.graph.kernels, atol=1e-4, rtol=0)


@every_isa
def test_particles_in_one_place(isa):
    state = ParticleState(*(value.repeat(100, 1) for value in vars(splash(1)).values()))
    assert_equals_warp(by_native(state, environment_of(), isa), state, environment_of())


@every_isa
def test_a_collapse_is_refused(isa):
    with pytest.raises(SimulationError, match="the simulation collapsed"):
        by_native(splash(3000, side=0.01), environment_of(), isa)


@every_isa
@pytest.mark.parametrize("far", [3.0, 1e3, 1e6, 1e9])
def test_particles_far_apart(isa, far):
    here, there = splash(80), shifted(splash(80, 1), far, -far, far)
    both = joined(here, there)
    if far <= 1e3:  # beyond, single precision rounds the distant positions to one
        assert_equals_warp(by_native(both, environment_of(), isa), both, environment_of())
    positions, _ = by_native(both, environment_of(), isa)
    alone, _ = by_native(here, environment_of(), isa)
    torch.testing.assert_close(positions[:80], alone, atol=1e-6, rtol=0)
    assert torch.isfinite(positions).all()


@every_isa
def test_results_depend_neither_on_the_order_of_particles_nor_on_the_number_of_threads(isa):
    state, environment = splash(2000, side=0.4), environment_of(BALL)
    threads, results = torch.get_num_threads(), {}
    try:
        for count in (1, 2):
            torch.set_num_threads(count)
            results[count] = by_native(state, environment, isa)
    finally:
        torch.set_num_threads(threads)
    assert torch.equal(results[1][0], results[2][0])
    assert torch.equal(results[1][1], results[2][1])
    order = torch.randperm(2000, generator=torch.Generator().manual_seed(3))
    shuffled = ParticleState(*(value[order] for value in vars(state).values()))
    _, velocities = by_native(shuffled, environment, isa)
    torch.testing.assert_close(velocities, results[1][1][order], atol=1e-4, rtol=1e-5)


def test_several_python_threads_may_share_a_solver():
    states, environment = [splash(1500, seed, side=0.4) for seed in range(4)], environment_of(BALL)
    alone = [by_native(state, environment, native.instruction_sets()[0]) for state in states]
    shared = NativeSolver()
    with ThreadPoolExecutor(4) as pool:
        for _ in range(5):
            together = pool.map(lambda state: shared.step(state, environment, handle_collisions=False), states)
            assert all(
                torch.equal(frame.positions, positions) for frame, (positions, _) in zip(together, alone, strict=True)
            )


@every_isa
@pytest.mark.parametrize("broken", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["positions", "velocities"])
@pytest.mark.parametrize("solid", ["none", "with map", "without map"])
def test_a_state_that_is_not_finite_is_refused(isa, name, broken, solid):
    state = splash(60)
    getattr(state, name)[3, 1] = broken
    environment = environment_of(None if solid == "none" else BALL)
    if solid == "without map":
        environment = replace(environment, boundary_map=None)
    with pytest.raises(SimulationError, match="not a finite number"):
        by_native(state, environment, isa)


class PythonSolid(Transformed):
    """A solid without C++ code."""

    def native_solid(self) -> None:
        return None


class NanAtOnePoint(PythonSolid):
    """A solid whose distance at the fourth point is NaN."""

    def distance_and_normal(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        distance, normal = super().distance_and_normal(points)
        return distance.index_fill(0, torch.tensor([3]), float("nan")), normal


@every_isa
def test_a_distance_of_nan_affects_only_the_particles_near_it(isa):
    state = joined(splash(60), splash(60, 1, low=1.5))
    whole = by_native(state, replace(environment_of(BALL), boundary_map=None), isa)
    broken = replace(environment_of(NanAtOnePoint(Sphere(0.3), None, (0.0, 0.0, 0.3))), boundary_map=None)
    positions, velocities = by_native(state, broken, isa)
    assert not torch.isfinite(positions[3]).all()
    assert torch.equal(positions[60:], whole[0][60:])
    assert torch.equal(velocities[60:], whole[1][60:])


def test_a_rollout_of_twenty_frames_stays_close_to_warp():
    grid = torch.cartesian_prod(*[torch.arange(8) * 0.03] * 3) + torch.tensor([-0.1, -0.1, 0.64])
    state, environment = ParticleState(grid, torch.zeros_like(grid) - 2.0 * GRAVITY / GRAVITY[2]), environment_of(BALL)
    ours = [now.positions for now, _ in DfsphSolver().rollout(state, environment, 21)]
    theirs = [now.positions for now, _ in warp_solver().rollout(state, environment, 21)]
    assert not torch.equal(ours[-1], theirs[-1])  # two implementations, not one
    assert (ours[-1] - theirs[-1]).abs().max() < 5e-5


def test_a_copied_solver_steps_as_the_original():
    solver, state, environment = DfsphSolver(), splash(100), environment_of(BALL)
    with torch.no_grad():
        first, _ = solver.step(state, environment)
        second, _ = copy.deepcopy(solver).step(state, environment)
    assert torch.equal(first.positions, second.positions)


def test_warp_steps_where_a_gradient_or_double_precision_is_needed():
    state, environment = splash(30), environment_of(BALL)
    assert can_step_native(state, environment)
    assert not can_step_native(ParticleState(state.positions.requires_grad_(), state.velocities), environment)
    with torch.no_grad():
        assert can_step_native(state, environment)
    assert not can_step_native(ParticleState(*(value.double() for value in vars(splash(30)).values())), environment)
    learning = Transformed(Sphere(torch.nn.Parameter(torch.tensor(0.3))))
    assert not can_step_native(splash(30), environment_of(learning))


def step_arguments(count: int = 10) -> dict[str, object]:
    vectors = {
        name: np.zeros((count, 3), np.float32)
        for name in ("positions", "velocities", "query_positions", "new_positions", "new_velocities")
    }
    container = {"lower": BOUNDS[0].numpy(), "upper": BOUNDS[1].numpy(), "gravity": GRAVITY.numpy()}
    solid = {"boundary_map": None, "rotation": np.eye(3, dtype=np.float32), "solid": None, "handle_collisions": True}
    rest = {"query_distance": np.zeros(count, np.float32), "collided": np.zeros(count, bool), "record": None}
    return (
        vectors
        | container
        | solid
        | rest
        | {
            "moving": None,
            "impulses": None,
            "liquids": None,
            "isa": native.instruction_sets()[0],
            "threads": 1,
            "max_pairs": 1000,
        }
    )


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("velocities", np.zeros((9, 3), np.float32), "velocities has 9 rows, but must have 10"),
        ("query_distance", np.zeros(9, np.float32), "query_distance has 9 rows, but must have 10"),
        ("isa", "cray", "does not support the instruction set 'cray'"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(name, value, complaint):
    solver = native.Solver(solver_parameters())
    assert solver.step(**step_arguments()).pairs == 10 * 9
    with pytest.raises(ValueError, match=complaint):
        solver.step(**step_arguments() | {name: value})


def test_an_output_array_that_would_be_converted_is_refused():
    with pytest.raises(TypeError):
        native.Solver(solver_parameters()).step(**step_arguments() | {"new_positions": np.zeros((10, 3))})


def test_parameters_that_make_no_solver_are_refused():
    with pytest.raises(ValueError, match="at least one substep"):
        native.Solver(native.SolverParameters())


def fall_on_ball(frames: int, environment: Environment) -> tuple[DfsphSolver, list[ParticleState]]:
    """A solver, and the states of its rollout."""
    solver, state, states = DfsphSolver(), splash(60), []
    with torch.no_grad():
        for _ in range(frames):
            states.append(state)
            state, _ = solver.step(state, environment)
    return solver, states


def test_only_particles_that_may_be_near_query_the_solid_again_and_the_bound_holds():
    queries = []

    class Counted(PythonSolid):
        def distance(self, points: torch.Tensor) -> torch.Tensor:
            queries.append(len(points))
            return super().distance(points)

        def distance_and_normal(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            return BALL.distance_and_normal(points)  # the queries of collision handling

    environment = replace(environment_of(BALL), surface=Counted(Sphere(0.3), None, (0.0, 0.0, 0.3)))
    solver, states = fall_on_ball(15, environment)
    assert queries[0] == 60 and 0 < sum(queries[1:15]) < 0.8 * 14 * 60
    for state in states:
        last = solver.native.step(state, environment).last_query
        predicted, _ = state.ballistic(GRAVITY)
        exact = BALL.distance(predicted)
        bound = last.distance - 2 * torch.linalg.vector_norm(predicted - last.positions, dim=-1)
        assert (bound <= exact + 1e-6).all()
        near = exact < CLEARANCE
        torch.testing.assert_close(bound[near], exact[near], atol=1e-6, rtol=0)


def test_a_solid_in_python_acts_as_the_same_solid_in_cpp():
    environment = environment_of(BALL)
    in_python = replace(environment, surface=PythonSolid(Sphere(0.3), None, (0.0, 0.0, 0.3)))
    for state, other in zip(fall_on_ball(15, environment)[1], fall_on_ball(15, in_python)[1], strict=True):
        torch.testing.assert_close(state.positions, other.positions, atol=1e-5, rtol=0)
        torch.testing.assert_close(state.velocities, other.velocities, atol=1e-3, rtol=0)


def test_an_error_of_a_solid_in_python_is_raised():
    class Broken(PythonSolid):
        def distance(self, points: torch.Tensor) -> torch.Tensor:
            raise RuntimeError("the solid is broken")

    environment = replace(environment_of(BALL), surface=Broken(Sphere(0.3)))
    with torch.no_grad(), pytest.raises(RuntimeError, match="the solid is broken"):
        DfsphSolver().step(splash(60), environment)


class KeepsPoints(PythonSolid):
    """A solid that keeps the points of its queries, and copies of them."""

    def __init__(self, *parts) -> None:
        super().__init__(*parts)
        self.kept: list[tuple[torch.Tensor, torch.Tensor]] = []

    def distance(self, points: torch.Tensor) -> torch.Tensor:
        self.kept.append((points, points.detach().clone()))
        return super().distance(points)

    def distance_and_normal(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        self.kept.append((points, points.detach().clone()))
        return super().distance_and_normal(points)


@pytest.mark.parametrize("with_map", [True, False])
def test_the_points_of_a_query_are_never_overwritten(with_map):
    surface = KeepsPoints(Sphere(0.3), None, (0.0, 0.0, 0.3))
    environment = Environment(surface, *BOUNDS, GRAVITY)
    if with_map:
        environment = replace(environment_of(BALL), surface=surface)
    fall_on_ball(6, environment)
    assert len(surface.kept) > 3
    assert all(torch.equal(points, then) for points, then in surface.kept)


@pytest.mark.parametrize("with_map", [True, False])
@pytest.mark.parametrize("surface", ["ball", "mesh", "network"])
def test_a_frame_with_collisions_equals_the_step_and_the_collision_handling_of_torch(surface, with_map, monkeypatch):
    solid = {
        "ball": Sphere(0.3),
        "mesh": MeshSurface(Sphere(0.3).to_mesh(24), cells=24),
        "network": fit_surface(load_siren(Path("coral")), 0.6),
    }[surface]
    solid = Transformed(solid, None, (0.0, 0.0, 0.3))
    environment = environment_of(solid) if with_map else replace(environment_of(solid), boundary_map=None)
    positions = torch.rand(20000, 3, generator=torch.Generator().manual_seed(1)) - torch.tensor([0.5, 0.5, 0.0])
    distance, normal = solid.distance_and_normal(positions)
    inward = ParticleState(positions, -20.0 * normal)  # faster than pressure can stop them
    state = ParticleState(*(value[(distance > 0.021) & (distance < 0.024)] for value in vars(inward).values()))
    parameters = solver_parameters.__wrapped__()
    parameters.max_energy_gain = float("inf")
    solver = NativeSolver()
    solver.solver = native.Solver(parameters)
    with torch.no_grad():
        frame = solver.step(state, environment)
        assert frame.finished and frame.collided.any()
        positions, velocities = by_warp(state, environment)
        monkeypatch.setattr("surfsup.sph.collision.can_run_native", lambda *_, **__: False)
        expected = resolve_collisions(state.positions, positions, velocities, environment)
    alike = (frame.positions - expected.positions).abs().amax(dim=-1) < 2e-5
    assert alike.float().mean() > 0.99  # in creases rounding may choose the other side
    assert alike[expected.collided].any()
    assert (frame.collided == expected.collided).float().mean() > 0.99
    torch.testing.assert_close(frame.velocities[alike], expected.velocities[alike], atol=5e-2, rtol=0)


def compressed(count: int = 400) -> ParticleState:
    """Particles so close to each other that their pressures would throw them apart."""
    return ParticleState(splash(count, side=0.1).positions, torch.zeros(count, 3))


def test_a_frame_that_gains_energy_is_left_unfinished_and_limited_by_the_caller():
    state, environment = compressed(), environment_of(BALL)
    frame = NativeSolver().step(state, environment)
    assert not frame.finished and not frame.collided.any()
    assert energy_gain(state, frame.positions, frame.velocities, GRAVITY) > MAX_ENERGY_GAIN
    after, _ = DfsphSolver().step(state, environment)
    assert energy_gain(state, after.positions, after.velocities, GRAVITY) <= MAX_ENERGY_GAIN


def test_without_a_map_a_shape_that_changes_between_frames_acts_as_it_is():
    ball = Sphere(0.1)
    environment = replace(environment_of(BALL), surface=Transformed(ball, None, (0.0, 0.0, 0.3)), boundary_map=None)
    solver, state = DfsphSolver(), ParticleState(torch.tensor([[0.0, 0.0, 0.55]]), torch.zeros(1, 3))
    with torch.no_grad():
        _, collided = solver.step(state, environment)
        assert not collided.any()
        ball.radius.fill_(0.3)
        after, collided = solver.step(state, environment)
    assert collided.all()
    assert float(environment.surface.distance(after.positions)) == pytest.approx(CLEARANCE, abs=1e-5)


def test_a_step_does_not_depend_on_earlier_steps():
    environment = environment_of(BALL)
    solver, states = fall_on_ball(15, environment)
    for state, after in pairwise(states):
        fresh, _ = DfsphSolver().step(state, environment)
        torch.testing.assert_close(fresh.positions, after.positions, atol=1e-6, rtol=0)
    other = replace(environment, surface=Sphere(0.1))
    expected, _ = DfsphSolver().step(states[0], other)
    assert torch.equal(solver.step(states[0], other)[0].positions, expected.positions)
    fewer = ParticleState(states[0].positions[:7], states[0].velocities[:7])
    assert len(solver.native.step(fewer, other).last_query.distance) == 7
