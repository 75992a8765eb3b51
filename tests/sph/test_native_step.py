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
from surfsup.learned import weights_file
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator
from surfsup.scene import Container
from surfsup.sdf import Box, MeshSurface, Sphere, Surface, Transformed, load_siren, standing
from surfsup.sph import native_step
from surfsup.sph.boundary.map_interpolation import SolidMap
from surfsup.sph.collision import ALLOWED, CLEARANCE, resolve_collisions
from surfsup.sph.energy import GAIN, energy_gain
from surfsup.sph.native_step import NativeStep
from surfsup.sph.state import FRAME_TIME, Environment, ParticleState

pytestmark = pytest.mark.skipif(
    not native.instruction_sets(), reason="the package was built without a compiler, so there is no native step"
)

GRAVITY = torch.tensor([0.0, 0.0, -9.81])
BALL = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.3))
QUARTER = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SOLIDS = ("a solid without a map", "a turned solid", "inside a solid")
every_path = pytest.mark.parametrize("path", native.instruction_sets())


BOUNDS = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])


def around(surface: Surface | None = None, gravity: torch.Tensor = GRAVITY) -> Environment:
    boundary_map = None if surface is None else SolidMap.of(surface, Container())
    return Environment(surface, *BOUNDS, gravity, boundary_map)


def model(seed: int = 0, width: int = 32, layers: int = 5, **sizes) -> CorrectedSimulator:
    torch.manual_seed(seed)
    made = CorrectedSimulator(Architecture(width=width, layers=layers, **sizes)).requires_grad_(False)
    torch.nn.init.normal_(made.network.decoder[-1].weight, std=0.1)
    return made


def stirred(count: int, seed: int = 0, low: float = 0.62, side: float = 0.2) -> ParticleState:
    """Water in a cube, its parts as unlike each other as they are after an impact."""
    random = torch.Generator().manual_seed(seed)

    positions = torch.rand(count, 3, generator=random) * side + torch.tensor([0.0, 0.0, low])
    return ParticleState(positions, torch.randn(count, 3, generator=random))


def moved(state: ParticleState, *by: float) -> ParticleState:
    return replace(state, positions=state.positions + torch.tensor(by))


def by_torch(
    simulator: CorrectedSimulator, state: ParticleState, place: Environment
) -> tuple[torch.Tensor, torch.Tensor]:
    simulator = copy.deepcopy(simulator)
    simulator.native = NativeStep()
    simulator.native.isa = ""
    seen = simulator.observe(state, place)
    return simulator.advance(seen, simulator.correct(seen))


def take(
    simulator: CorrectedSimulator, state: ParticleState, place: Environment, path: str
) -> tuple[torch.Tensor, torch.Tensor]:
    return NativeStep(path).take(simulator, state, place, handle_collisions=False)[:2]


def assert_equal(
    ours: tuple[torch.Tensor, torch.Tensor], simulator: CorrectedSimulator, state: ParticleState, place: Environment
):
    """Within 1e-4 of a correction's unit, but for the rounding of the positions themselves."""
    positions, velocities = by_torch(simulator, state, place)
    size = 1 + (velocities - state.velocities).abs().max() * FRAME_TIME / DISPLACEMENT_SCALE
    unit = 1e-4 * DISPLACEMENT_SCALE * float(size)
    torch.testing.assert_close(ours[1] * FRAME_TIME, velocities * FRAME_TIME, atol=unit, rtol=2e-7)
    torch.testing.assert_close(ours[0], positions, atol=unit + 1.2e-7, rtol=2e-7)


@every_path
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 400), side=st.floats(0.08, 1.0))
@settings(max_examples=20)
def test_it_equals_torch_on_random_states_beside_a_solid(path, seed, count, side):
    simulator, state = model(), stirred(count, seed, side=side)
    assert_equal(take(simulator, state, around(BALL), path), simulator, state, around(BALL))


@every_path
@pytest.mark.parametrize("place", ["nothing", "floor", "corner", "tilted", *SOLIDS])
def test_it_equals_torch_wherever_the_water_is(path, place):
    state, surroundings = {
        "nothing": (stirred(300), around()),
        "floor": (stirred(300, low=0.02), around()),
        "corner": (moved(stirred(300), -0.52, -0.52, -0.65), around()),
        "tilted": (stirred(300), around(BALL, torch.tensor([3.0, 0.0, -5.0]))),
        "a solid without a map": (stirred(300), replace(around(BALL), boundary_map=None)),
        "a turned solid": (stirred(300), around(BALL).transformed_by(QUARTER)),
        "inside a solid": (stirred(300, low=0.3), around(Transformed(Box((0.4, 0.4, 0.4)), None, (0.0, 0.0, 0.4)))),
    }[place]
    simulator = model()
    assert_equal(take(simulator, state, surroundings, path), simulator, state, surroundings)


@every_path
@pytest.mark.parametrize(("width", "layers"), [(8, 1), (16, 2), (24, 3), (32, 5), (40, 1), (48, 2), (64, 4), (7, 2)])
def test_any_width_and_any_number_of_layers(path, width, layers):
    simulator, state = model(width=width, layers=layers), stirred(150)
    assert_equal(take(simulator, state, around(BALL), path), simulator, state, around(BALL))


@every_path
@pytest.mark.parametrize(("width", "messages"), [(32, 16), (48, 16), (48, 32), (32, 5), (24, 20), (7, 1)])
def test_neighbors_that_are_told_of_some_channels_only(path, width, messages):
    simulator, state = model(width=width, layers=3, messages=messages), stirred(150)
    assert_equal(take(simulator, state, around(BALL), path), simulator, state, around(BALL))


def test_neighbors_are_told_of_one_channel_at_least_and_of_all_at_most():
    for messages in (0, 33):
        with pytest.raises(ValueError, match=f"messages is {messages}, but must be 1 to 32, the width"):
            Architecture(width=32, messages=messages)


@every_path
def test_another_radius(path):
    simulator, state = model(radius=0.045), stirred(300)
    assert_equal(take(simulator, state, around(), path), simulator, state, around())


@every_path
def test_nothing_one_and_two_particles(path):
    for count in (0, 1, 2):
        simulator, state = model(), stirred(count, side=0.02)
        positions, velocities = take(simulator, state, around(BALL), path)
        assert positions.shape == velocities.shape == (count, 3)
        if count:
            assert_equal((positions, velocities), simulator, state, around(BALL))


@every_path
def test_corrections_without_bounds_are_shortened_as_torch_shortens_them(path):
    simulator, state = model(), stirred(300)
    torch.nn.init.normal_(simulator.network.decoder[-1].weight, std=1e5)
    positions, velocities = take(simulator, state, around(BALL), path)
    change = (velocities - simulator.observe(state, around(BALL)).speeds).norm(dim=-1)
    assert (change > 4.999).float().mean() > 0.2  # the others, with their neighbors, are said negative pressures
    assert change.max() <= 5.001
    assert_equal((positions, velocities), simulator, state, around(BALL))


@every_path
def test_particles_on_top_of_each_other(path):
    simulator, one = model(), stirred(1)
    state = ParticleState(*(value.repeat(100, 1) for value in vars(one).values()))
    assert_equal(take(simulator, state, around(), path), simulator, state, around())


@every_path
def test_a_collapse_ends_with_one_line(path):
    state = stirred(3000, side=0.01)
    with pytest.raises(SimulationError, match="the simulation collapsed"):
        take(model(), state, around(), path)


@every_path
@pytest.mark.parametrize("far", [3.0, 1e3, 1e6, 1e9])
def test_particles_far_apart(path, far):
    here, there = stirred(80), stirred(80, 1)
    there = moved(there, far, -far, far)
    both = ParticleState(*(torch.cat(pair) for pair in zip(vars(here).values(), vars(there).values(), strict=True)))
    if far <= 1e3:  # beyond, positions are too coarse to be compared
        assert_equal(take(model(), both, around(), path), model(), both, around())
    ours = take(model(), both, around(), path)
    alone = take(model(), here, around(), path)
    torch.testing.assert_close(ours[0][:80], alone[0], atol=1e-6, rtol=0)
    assert torch.isfinite(ours[0]).all()


@every_path
def test_a_particle_s_answer_does_not_depend_on_the_order_nor_on_the_threads(path):
    simulator, state = model(), stirred(2000, side=0.4)
    mixed = torch.randperm(2000, generator=torch.Generator().manual_seed(3))
    threads = torch.get_num_threads()
    answers = {}
    try:
        for count in (1, 2):
            torch.set_num_threads(count)
            answers[count] = take(simulator, state, around(BALL), path)
    finally:
        torch.set_num_threads(threads)
    assert torch.equal(answers[1][0], answers[2][0])
    assert torch.equal(answers[1][1], answers[2][1])
    again = take(simulator, ParticleState(*(value[mixed] for value in vars(state).values())), around(BALL), path)
    torch.testing.assert_close(again[1], answers[1][1][mixed], atol=1e-4, rtol=1e-5)


def test_several_threads_of_python_may_step_at_once():
    simulator, states = model(), [stirred(1500, seed, side=0.4) for seed in range(4)]
    alone = [take(simulator, state, around(BALL), native.instruction_sets()[0]) for state in states]
    shared = NativeStep()
    with ThreadPoolExecutor(4) as pool:
        for _ in range(5):
            together = pool.map(
                lambda state: shared.take(simulator, state, around(BALL), handle_collisions=False), states
            )
            assert all(torch.equal(one[0], other[0]) for one, other in zip(together, alone, strict=True))


@every_path
@pytest.mark.parametrize("broken", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["positions", "velocities"])
def test_a_place_that_is_no_number_is_refused(path, name, broken):
    state = stirred(60)
    getattr(state, name)[3, 1] = broken
    with pytest.raises(SimulationError, match="not a finite number"):
        take(model(), state, around(BALL), path)


class Torn(Transformed):
    """A solid whose distance from the fourth point is no number."""

    def native_solid(self) -> None:
        return None

    def distance_and_normal(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        distance, normal = super().distance_and_normal(points)
        return distance.index_fill(0, torch.tensor([3]), float("nan")), normal


@every_path
def test_a_distance_that_is_no_number_harms_only_those_that_see_it(path):
    here, there = stirred(60), stirred(60, 1, low=1.5)
    state = ParticleState(*(torch.cat(pair) for pair in zip(vars(here).values(), vars(there).values(), strict=True)))
    simulator = model()
    whole = take(simulator, state, replace(around(BALL), boundary_map=None), path)
    torn = replace(around(Torn(Sphere(0.3), None, (0.0, 0.0, 0.3))), boundary_map=None)
    positions, velocities = take(simulator, state, torn, path)
    assert not torch.isfinite(positions[3]).all()
    assert torch.equal(positions[60:], whole[0][60:])
    assert torch.equal(velocities[60:], whole[1][60:])


def test_a_rollout_of_twenty_frames_stays_with_torch_s():
    simulator, _ = weights_file.load(weights_file.find("fast"))
    grid = torch.cartesian_prod(*[torch.arange(8) * 0.03] * 3) + torch.tensor([-0.1, -0.1, 0.64])
    place = around(BALL)
    state = simulator.start(grid, torch.zeros_like(grid) + torch.tensor([0.0, 0.0, -2.0]), place)
    ours = [now.positions for now, _ in simulator.rollout(state, place, 21)]
    simulator.native.isa = ""
    theirs = [now.positions for now, _ in simulator.rollout(state, place, 21)]
    assert not torch.equal(ours[-1], theirs[-1])  # both ways were gone
    assert (ours[-1] - theirs[-1]).abs().max() < 5e-5


def test_new_weights_are_used_at_once():
    simulator, state = model(), stirred(100)
    with torch.no_grad():
        first, _ = simulator.step(state, around())
        simulator.network.layers[0].mix.weight.mul_(0.5)
        halved, _ = simulator.step(state, around())
        simulator.load_state_dict(model(seed=1).state_dict())
        loaded, _ = simulator.step(state, around())
        fresh, _ = model(seed=1).step(state, around())
        twin = copy.deepcopy(simulator)
        copied, _ = twin.step(state, around())
    assert not torch.equal(first.positions, halved.positions)
    assert torch.equal(loaded.positions, fresh.positions)
    assert torch.equal(copied.positions, fresh.positions)


@pytest.mark.parametrize("how", [{}, {"fused": True}, {"foreach": True}])
def test_what_an_optimizer_writes_is_used_at_once(how):
    simulator, state = model().requires_grad_(True), stirred(100)
    adam = torch.optim.Adam(simulator.parameters(), lr=0.01, **how)
    for _ in range(2):
        with torch.no_grad():
            found, _ = simulator.step(state, around())
            fresh, _ = copy.deepcopy(simulator).step(state, around())
        assert torch.equal(found.positions, fresh.positions)
        adam.zero_grad()
        simulator.step(state, around())[0].positions.square().sum().backward()
        adam.step()


def test_torch_takes_over_where_a_gradient_or_more_precision_is_wanted():
    simulator, state, place = model(), stirred(30), around(BALL)
    can = simulator.native.can_take
    assert not can(state, place, simulator.network)  # gradients are being recorded
    with torch.no_grad():
        assert can(state, place, simulator.network)
        double = ParticleState(*(value.double() for value in vars(state).values()))
        assert not can(double, place, simulator.network)
        assert not can(state, place, simulator.network.double())


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("velocities", np.zeros((9, 3), np.float32), "velocities has 9 rows, but must have 10"),
        ("last", (np.zeros((10, 3), np.float32), np.zeros(9, np.float32)), "distance has 9 rows, but must have 10"),
        ("path", "cray", "cannot go the path 'cray'"),
    ],
)
def test_what_does_not_fit_is_refused(name, value, complaint):
    simulator, place = model(), around()
    arrays = {
        "positions": np.zeros((10, 3), np.float32),
        "velocities": np.zeros((10, 3), np.float32),
        "around": place.as_arrays,
        "map": None,
        "turn": torch.eye(3).numpy(),
        "solid": None,
        "clearance": ALLOWED,
        "handle_collisions": True,
        "most_gain": 0.0,
        "last": (np.zeros((10, 3), np.float32), np.zeros(10, np.float32)),
        "reached": (np.zeros((10, 3), np.float32), np.zeros((10, 3), np.float32), np.zeros(10, bool)),
        "path": native.instruction_sets()[0],
        "threads": 1,
        "max_edges": 1000,
    }
    network = simulator.native.network_of(simulator)
    assert network.next_frame(**arrays)[0] == 10 * 9
    with pytest.raises(ValueError, match=complaint):
        network.next_frame(**arrays | {name: value})


def test_what_would_be_converted_and_so_written_to_a_copy_is_refused():
    simulator, state, place = model(), stirred(10), around()
    reached = (np.zeros((10, 3)), np.zeros((10, 3), np.float32), np.zeros(10, bool))
    positions, velocities = (value.numpy() for value in vars(state).values())
    last = (np.zeros((10, 3), np.float32), np.zeros(10, np.float32))
    with pytest.raises(TypeError):
        simulator.native.network_of(simulator).next_frame(
            positions, velocities, place.as_arrays, None, torch.eye(3).numpy(), None, ALLOWED, True, 0.0, last, reached,
            native.instruction_sets()[0], 1, 1000,
        )  # fmt: skip


def fallen(frames: int, place: Environment) -> tuple[CorrectedSimulator, list[ParticleState]]:
    """A model, and the states of its rollout on a ball."""
    simulator, state, states = model(layers=1), stirred(60), []
    with torch.no_grad():
        for _ in range(frames):
            states.append(state)
            state, _ = simulator.step(state, place)
    return simulator, states


def test_the_solid_is_asked_again_only_by_those_that_may_be_near_and_is_never_nearer_than_told():
    place, asked = around(BALL), []

    class Asked(Transformed):
        def native_solid(self) -> None:
            return None

        def distance(self, points: torch.Tensor) -> torch.Tensor:
            asked.append(len(points))
            return super().distance(points)

        def distance_and_normal(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            return BALL.distance_and_normal(points)  # so asks the guard

    watched = replace(place, surface=Asked(Sphere(0.3), None, (0.0, 0.0, 0.3)))
    simulator, states = fallen(15, watched)
    assert asked[0] == 60 and 0 < sum(asked[1:15]) < 0.8 * 14 * 60
    for state in states:
        simulator.native.take(simulator, state, watched)
        ahead, exact = state.ballistic(GRAVITY)[0], BALL.distance(state.ballistic(GRAVITY)[0])
        places, distance = (torch.from_numpy(value) for value in simulator.native.looked[1])
        told = distance - 2 * torch.linalg.vector_norm(ahead - places, dim=-1)
        assert (told <= exact + 1e-6).all()
        near = exact < CLEARANCE
        torch.testing.assert_close(told[near], exact[near], atol=1e-6, rtol=0)


def test_a_solid_in_cpp_is_asked_as_one_in_python_is():
    class InPython(Transformed):
        def native_solid(self) -> None:
            return None

    place = around(BALL)
    _, states = fallen(15, place)
    _, others = fallen(15, replace(place, surface=InPython(Sphere(0.3), None, (0.0, 0.0, 0.3))))
    for state, other in zip(states, others, strict=True):
        torch.testing.assert_close(state.positions, other.positions, atol=1e-5, rtol=0)
        torch.testing.assert_close(state.velocities, other.velocities, atol=1e-3, rtol=0)


def test_an_error_of_a_solid_in_python_comes_through():
    class Broken(Transformed):
        def native_solid(self) -> None:
            return None

        def distance(self, points: torch.Tensor) -> torch.Tensor:
            raise RuntimeError("the solid is broken")

    place = replace(around(BALL), surface=Broken(Sphere(0.3)))
    with torch.no_grad(), pytest.raises(RuntimeError, match="the solid is broken"):
        model(layers=1).step(stirred(60), place)


class Kept(Transformed):
    """A surface that keeps what it was asked, and what that was then."""

    def __init__(self, *parts) -> None:
        super().__init__(*parts)
        self.kept: list[tuple[torch.Tensor, torch.Tensor]] = []

    def native_solid(self) -> None:
        return None

    def distance(self, points: torch.Tensor) -> torch.Tensor:
        self.kept.append((points, points.detach().clone()))
        return super().distance(points)

    def distance_and_normal(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        self.kept.append((points, points.detach().clone()))
        return super().distance_and_normal(points)


@pytest.mark.parametrize("mapped", [True, False])
def test_what_a_solid_in_python_was_asked_stays_as_it_was(mapped):
    surface = Kept(Sphere(0.3), None, (0.0, 0.0, 0.3))
    place = replace(around(BALL), surface=surface) if mapped else Environment(surface, *BOUNDS, GRAVITY)
    fallen(6, place)
    assert len(surface.kept) > 3
    assert all(torch.equal(points, then) for points, then in surface.kept)


@pytest.mark.parametrize("mapped", [True, False])
@pytest.mark.parametrize("surface", ["ball", "mesh", "network"])
def test_a_guarded_frame_is_torch_s_step_and_torch_s_guard(surface, mapped, monkeypatch):
    solid = {
        "ball": Sphere(0.3),
        "mesh": MeshSurface(Sphere(0.3).to_mesh(24), cells=24),
        "network": standing(load_siren(Path("coral")), 0.6),
    }[surface]
    solid = Transformed(solid, None, (0.0, 0.0, 0.3))
    place = around(solid) if mapped else replace(around(solid), boundary_map=None)
    positions = torch.rand(20000, 3, generator=torch.Generator().manual_seed(1)) - torch.tensor([0.5, 0.5, 0.0])
    distance, normal = solid.distance_and_normal(positions)
    inward = ParticleState(positions, -20.0 * normal)  # faster than the rule and the network may stop them
    state = ParticleState(*(value[(distance > 0.021) & (distance < 0.024)] for value in vars(inward).values()))
    simulator = model(layers=1)
    monkeypatch.setattr(native_step, "GAIN", float("inf"))
    with torch.no_grad():
        taken = simulator.native.take(simulator, state, place)
        assert taken.done and taken.moved.any()
        positions, velocities = by_torch(simulator, state, place)
        monkeypatch.setattr("surfsup.sph.collision.can_resolve_natively", lambda *_: False)
        kept = resolve_collisions(state.positions, positions, velocities, place)
    alike = (taken.positions - kept.positions).abs().amax(dim=-1) < 2e-5
    assert alike.float().mean() > 0.99  # in creases rounding may send a particle the other way
    assert alike[kept.moved].any()
    assert (taken.moved == kept.moved).float().mean() > 0.99
    torch.testing.assert_close(taken.velocities[alike], kept.velocities[alike], atol=5e-2, rtol=0)


def test_a_frame_that_would_gain_energy_is_left_to_be_cut_back():
    simulator, state, place = model(layers=1), stirred(400), around(BALL)
    torch.nn.init.normal_(simulator.network.decoder[-1].weight, std=100.0)
    with torch.no_grad():
        taken = simulator.native.take(simulator, state, place)
        assert not taken.done and not taken.moved.any()
        assert energy_gain(state, taken.positions, taken.velocities, GRAVITY) > GAIN
        after, _ = simulator.step(state, place)
    assert energy_gain(state, after.positions, after.velocities, GRAVITY) <= GAIN


def test_without_a_map_a_shape_that_changes_is_seen_as_it_is():
    ball = Sphere(0.1)
    place = replace(around(BALL), surface=Transformed(ball, None, (0.0, 0.0, 0.3)), boundary_map=None)
    simulator, state = model(layers=1), ParticleState(torch.tensor([[0.0, 0.0, 0.55]]), torch.zeros(1, 3))
    with torch.no_grad():
        _, moved = simulator.step(state, place)
        assert not moved.any()
        ball.radius.fill_(0.3)
        after, moved = simulator.step(state, place)
    assert moved.all()
    assert float(place.surface.distance(after.positions)) == pytest.approx(CLEARANCE, abs=1e-5)


def test_a_step_does_not_depend_on_the_steps_before():
    place = around(BALL)
    simulator, states = fallen(15, place)
    for state, after in pairwise(states):
        with torch.no_grad():
            anew, _ = model(layers=1).step(state, place)
        torch.testing.assert_close(anew.positions, after.positions, atol=1e-6, rtol=0)
    with torch.no_grad():
        elsewhere = replace(place, surface=Sphere(0.1))
        simulator.step(states[0], elsewhere)
        assert simulator.native.looked[0] is elsewhere
        fewer = ParticleState(states[0].positions[:7], states[0].velocities[:7])
        simulator.step(fewer, elsewhere)
        assert len(simulator.native.looked[1][0]) == 7
