import math

import pytest
import torch

from surfsup.learned.message_passing.architecture import SIZES, MessagePassingArchitecture
from surfsup.learned.message_passing.gns import GnsArchitecture
from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import join_seen
from surfsup.scene import FRAME_TIME
from surfsup.sdf import Sphere, Surface, Transformed
from tests.learned.message_passing.scenes import GRAVITY, PAPERS, around, ball, simulator, water

kinds = pytest.mark.parametrize("kind", PAPERS)


class Twisted(Surface):
    """The ball, its distance right and its gradient another."""

    def __init__(self, inner: Surface) -> None:
        super().__init__()
        self.inner = inner

    def distance(self, points):
        return self.inner.distance(points)

    def bounds(self):
        return self.inner.bounds()

    def distance_and_normal(self, points):
        distance, normal = self.inner.distance_and_normal(points)
        return distance, normal.roll(1, dims=-1)


def predicted(made, state, surroundings) -> torch.Tensor:
    with torch.no_grad():
        return made.predict(made.observe(state, surroundings))


def shuffled(state: History, order: torch.Tensor) -> History:
    return History(*(value[order] for value in vars(state).values()))


@kinds
def test_the_order_of_particles_does_not_matter(kind):
    made, state = simulator(kind, dtype=torch.float64), water(dtype=torch.float64)
    surroundings, order = around(ball(torch.float64), torch.float64), torch.randperm(40)
    straight, _ = made.step(state, surroundings)
    permuted, _ = made.step(shuffled(state, order), surroundings)
    for one, other in zip(vars(permuted).values(), vars(straight).values(), strict=True):
        torch.testing.assert_close(one, other[order])


PINNED = {
    "surfsup": [1.1658841, 0.7060784, -2.8615203, 1.1383523, 0.6163803, -2.7333502, 1.1642656, 0.70988, -2.8641672],
    "value-only": [1.1652752, 0.6935974, -2.8469083, 1.1059872, 0.5227475, -2.595932, 1.1706856, 0.565266, -2.7083348],
    "no-sdf": [1.1441823, 0.435029, -2.5357097, 1.1057504, 0.4692918, -2.5357195, 1.1720763, 0.5547171, -2.69789],
    "gns": [1.1651136, 0.4033604, -2.5211099, 1.1684107, 0.4377821, -2.563027, 1.1304502, 0.62969, -2.740381],
}


@kinds
def test_the_outputs_are_those_of_the_day_it_was_made(kind):
    made = simulator(kind, dtype=torch.float64)
    # Weights from a formula: random numbers may change between versions of torch.
    with torch.no_grad():
        for number, parameter in enumerate(made.parameters()):
            count = torch.arange(parameter.numel(), dtype=torch.float64)
            parameter.copy_((0.7 * torch.sin(1.3 * count + number)).reshape(parameter.shape))
    count = torch.arange(8, dtype=torch.float64)
    positions = torch.stack([0.05 * count.cos(), 0.05 * count.sin(), 0.52 + 0.01 * count], dim=1)
    moves = 0.004 * torch.sin(torch.arange(96, dtype=torch.float64)).reshape(8, 4, 3)
    state = History(positions, positions.flip(1), moves)
    # A grid for the surface's particles: the drawn ones may change with the library that draws them.
    if kind == "gns":
        made.particles.on = lambda surface: (
            torch.cartesian_prod(*[torch.arange(3) * 0.05] * 3) + torch.tensor([0, 0, 0.4])
        )
    out = predicted(made, state, around(ball(torch.float64), torch.float64))
    torch.testing.assert_close(out[[0, 3, 7], :].flatten(), torch.tensor(PINNED[kind]).double(), atol=1e-6, rtol=1e-6)


def test_surfsup_is_told_its_moves_the_walls_the_distance_and_its_gradient():
    made = simulator("surfsup", radius=0.045)
    state = History(torch.tensor([[0.1, 0.05, 0.545], [0.49, 0.0, 1.9]]), torch.zeros(2, 3), torch.zeros(2, 4, 3))
    state.moves[0, 0] = torch.tensor([1.9e-3, 0.0, -4.1e-3])
    features = made.observe(state, around(ball())).features
    expected = torch.zeros(2, 22)
    expected[0, 0], expected[0, 2] = 1.0, -1.0
    expected[:, 12:18] = 1.0
    expected[1, 15] = 0.01 / 0.045
    expected[0, 18:] = torch.tensor([0.045 / 0.09, 0, 0, 1])
    expected[1, 18] = 2.0
    expected[1, 19:] = ball().distance_and_normal(state.positions)[1][1]
    torch.testing.assert_close(features, expected, atol=1e-5, rtol=0)


def test_without_a_surface_the_distance_is_the_farthest():
    features = simulator("surfsup").observe(water(), around()).features
    assert torch.equal(features[:, 18:], torch.tensor([2.0, 0.0, 0.0, 0.0]).expand(40, 4))


def test_value_only_ignores_the_gradient_and_surfsup_does_not():
    for kind, ignores in (("value-only", True), ("surfsup", False)):
        made, state = simulator(kind), water()
        same = torch.equal(predicted(made, state, around(ball())), predicted(made, state, around(Twisted(ball()))))
        assert same == ignores, kind


def test_no_sdf_ignores_the_surface_and_the_others_do_not():
    for kind in PAPERS:
        made, state = simulator(kind), water()
        same = torch.equal(predicted(made, state, around(ball())), predicted(made, state, around()))
        assert same == (kind == "no-sdf"), kind


def test_the_surface_particles_of_gns_stay_where_they_are():
    made, surroundings = simulator("gns"), around(ball())
    before = made.particles.on(surroundings.surface).clone()
    states = [state for state, _ in made.rollout(water(), surroundings, 4)]
    assert all(len(state.positions) == 40 for state in states)
    nodes = made.nodes(states[-1], surroundings)
    assert torch.equal(nodes.positions[40:], before)
    assert len(before) == 150
    assert not nodes.moves[40:].any()
    kinds_of = made.see_extra(nodes, surroundings)
    assert torch.equal(kinds_of[:40], torch.tensor([1.0, 0.0]).expand(40, 2))
    assert torch.equal(kinds_of[40:], torch.tensor([0.0, 1.0]).expand(150, 2))


def test_gns_feels_a_surface_particle_as_a_node_of_its_graph():
    made, state = simulator("gns"), water(5)
    seen = made.observe(state, around(ball()))
    assert len(seen.graph) == len(seen.features) == 155
    across = (seen.graph.neighborhood.receivers < 5) & (seen.graph.neighborhood.senders >= 5)
    assert across.any()
    assert torch.equal(seen.fluid, torch.arange(5))


@kinds
def test_scenes_side_by_side_are_predicted_as_on_their_own(kind):
    made = simulator(kind, dtype=torch.float64)
    parts = [
        made.observe(water(count, count, torch.float64), around(surface, torch.float64))
        for count, surface in ((20, ball(torch.float64)), (7, None), (1, Sphere(0.4).double()))
    ]
    torch.testing.assert_close(made.predict(join_seen(parts)), torch.cat([made.predict(part) for part in parts]))


@kinds
def test_what_is_wanted_leads_to_the_true_next_step(kind):
    made, state = simulator(kind, dtype=torch.float64), water(dtype=torch.float64)
    move, velocities = 0.01 * torch.randn(40, 3).double(), torch.randn(40, 3).double()
    wanted = made.wanted(state, move, velocities)
    assert wanted.shape == (40, made.outputs)
    after, speeds = made.advance(state, wanted)
    torch.testing.assert_close(after, state.positions + move)
    torch.testing.assert_close(speeds, move / FRAME_TIME)


@kinds
def test_from_a_noisy_state_the_wanted_step_undoes_the_noise_of_the_move_alone(kind):
    made, state = simulator(kind, dtype=torch.float64), water(dtype=torch.float64)
    noisy = made.with_noise(state, 1e-3, torch.Generator().manual_seed(2))
    move = 0.01 * torch.randn(40, 3).double()
    after, _ = made.advance(noisy, made.wanted(noisy, move, state.velocities))
    torch.testing.assert_close(after - noisy.positions, move)
    assert torch.equal(noisy.velocities, state.velocities)


@kinds
def test_normalization_is_measured_from_examples(kind):
    made = simulator(kind, dtype=torch.float64)
    examples = [
        (water(500, seed, torch.float64), 0.01 * torch.randn(500, 3).double(), torch.randn(500, 3).double())
        for seed in (1, 2)
    ]
    made.measure(examples)
    wanted = torch.cat([made.wanted(*example) for example in examples])
    torch.testing.assert_close(wanted.mean(dim=0), torch.zeros(made.outputs).double(), atol=1e-9, rtol=0)
    torch.testing.assert_close(wanted.std(dim=0, correction=0), torch.ones(made.outputs).double())
    told = torch.cat([made.moves.normalize(example[0].moves) for example in examples])
    torch.testing.assert_close(told.std(dim=(0, 1), correction=0), torch.ones(3).double())


@kinds
@pytest.mark.parametrize(("history", "stride"), [(4, 1), (2, 3)])
def test_a_network_that_predicts_no_change_but_gravity_falls_freely(kind, history, stride):
    made = simulator(kind, dtype=torch.float64, history=history, stride=stride)
    step = stride * FRAME_TIME
    with torch.no_grad():
        for parameter in made.network.decoder[-1].parameters():
            parameter.zero_()
        made.accelerations.mean.copy_(step**2 * GRAVITY)
    surroundings = around(ball(torch.float64), torch.float64)
    start, velocities = torch.tensor([[0.1, 0.1, 1.5]]).double(), torch.tensor([[0.5, 0.0, 0.3]]).double()
    rollout = made.rollout(made.start(start, velocities, surroundings), surroundings, 8)
    for frame, (now, moved) in enumerate(rollout):
        # n frames of five solver steps h: n·5h·v + (5n)(5n+1)/2·h²·g
        steps, h = 5 * frame, FRAME_TIME / 5
        expected = start + steps * h * velocities + steps * (steps + 1) / 2 * h**2 * GRAVITY.double()
        torch.testing.assert_close(now.positions, expected, atol=1e-9, rtol=0)
        assert not moved.any()
    assert frame == 7


@kinds
def test_a_true_window_and_a_start_are_states_of_one_kind(kind):
    made = simulator(kind, history=3, stride=2)
    assert made.past == 6
    positions, velocities = torch.randn(7, 5, 3), torch.randn(7, 5, 3)
    state = made.state_after(positions, velocities)
    assert torch.equal(state.positions, positions[-1]) and torch.equal(state.velocities, velocities[-1])
    torch.testing.assert_close(state.moves[:, 2], positions[2] - positions[0])
    assert made.start(positions[0], velocities[0], around()).moves.shape == state.moves.shape


@kinds
def test_a_rollout_starts_with_the_start_and_repeats_bit_for_bit(kind):
    made, state = simulator(kind), water()
    runs = [list(made.rollout(state, around(ball()), 5)) for _ in range(2)]
    assert [len(run) for run in runs] == [5, 5]
    assert runs[0][0][0] is state
    assert all(torch.equal(a.positions, b.positions) for (a, _), (b, _) in zip(*runs, strict=True))


@kinds
@pytest.mark.parametrize("stride", [1, 3])
def test_the_guard_keeps_every_frame_outside_and_can_be_left_out(kind, stride):
    made, surroundings = simulator(kind, stride=stride), around(ball())
    positions = torch.tensor([[0.1, 0.05, 0.56], [0.3, 0.1, 0.5]])
    state = made.start(positions, torch.tensor([[0.0, 0.0, -8.0]] * 2), surroundings)
    kept = list(made.rollout(state, surroundings, 7))
    assert all((surroundings.surface.distance(now.positions) > 0).all() for now, _ in kept)
    assert any(moved.any() for _, moved in kept)
    free = list(made.rollout(state, surroundings, 7, handle_collisions=False))
    assert any((surroundings.surface.distance(now.positions) < 0).any() for now, _ in free)
    assert not any(moved.any() for _, moved in free)


def test_the_gradient_in_a_shape_parameter_is_that_of_finite_differences():
    made, state = simulator("surfsup", dtype=torch.float64), water(15, dtype=torch.float64)

    def height(radius: torch.Tensor) -> torch.Tensor:
        surroundings = around(Transformed(Sphere(radius), None, (0.1, 0.05, 0.25)).double(), torch.float64)
        now = state
        for _ in range(3):
            now, _ = made.step(now, surroundings, handle_collisions=False)
        return now.positions[:, 2].mean() / 3e-4

    radius = torch.tensor(0.25, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(height(radius), radius)
    step = 1e-6
    with torch.no_grad():
        rise = height(radius + step) - height(radius - step)
    assert abs(gradient) > 1e-3
    torch.testing.assert_close(gradient, rise / (2 * step), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(
    "sizes",
    [
        {"width": 0},
        {"layers": 1.5},
        {"radius": 0.0},
        {"radius": math.nan},
        {"history": 0},
        {"stride": True},
        {"stride": 101},
    ],
)
def test_sizes_that_make_no_sense_are_refused_by_name(sizes):
    with pytest.raises(ValueError, match=next(iter(sizes))):
        MessagePassingArchitecture(**sizes)


def test_the_paper_s_size_is_the_default_and_has_the_published_number_of_steps():
    default = MessagePassingArchitecture()
    assert {"width": default.width, "layers": default.layers} == SIZES["paper"] == {"width": 128, "layers": 10}
    assert default.history == 4
    with pytest.raises(ValueError, match="surface_particles"):
        GnsArchitecture(surface_particles=0)
