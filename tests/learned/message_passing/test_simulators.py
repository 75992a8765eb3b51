import math

import pytest
import torch

from surfsup.learned.message_passing.architecture import SIZES, MessagePassingArchitecture
from surfsup.learned.message_passing.gns import GnsArchitecture
from surfsup.learned.message_passing.history import HISTORY_LENGTH, History
from surfsup.learned.message_passing.simulator import batch_inputs
from surfsup.scene import FRAME_TIME
from surfsup.sdf import Sphere, Surface, Transformed
from tests.learned.message_passing.scenes import GRAVITY, MESSAGE_PASSING, ball, make_environment, make_simulator, water

kinds = pytest.mark.parametrize("kind", MESSAGE_PASSING)


class Twisted(Surface):
    """The ball with its true distance and a wrong gradient."""

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


def predict(simulator, state, environment) -> torch.Tensor:
    with torch.no_grad():
        return simulator.predict_acceleration(simulator.network_input(state, environment))


def permute(state: History, order: torch.Tensor) -> History:
    return History(*(value[order] for value in vars(state).values()))


@kinds
def test_the_order_of_particles_does_not_matter(kind):
    simulator, state = make_simulator(kind, dtype=torch.float64), water(dtype=torch.float64)
    environment, order = make_environment(ball(torch.float64), torch.float64), torch.randperm(40)
    ordered, _ = simulator.step(state, environment)
    permuted, _ = simulator.step(permute(state, order), environment)
    for one, other in zip(vars(permuted).values(), vars(ordered).values(), strict=True):
        torch.testing.assert_close(one, other[order])


PINNED = {
    ("surfsup", 2): [
        1.1658845,
        0.7060685,
        -2.8615097,
        1.1383538,
        0.6163291,
        -2.7332942,
        1.164011,
        0.7094064,
        -2.8633812,
    ],
    ("surfsup", 1): [
        1.1658841,
        0.7060784,
        -2.8615203,
        1.1383523,
        0.6163803,
        -2.7333502,
        1.1642656,
        0.70988,
        -2.8641672,
    ],
    ("value-only", 2): [
        1.1652752,
        0.6935974,
        -2.8469083,
        1.1059872,
        0.5227475,
        -2.595932,
        1.1706856,
        0.565266,
        -2.7083348,
    ],
    ("no-sdf", 2): [1.1441823, 0.435029, -2.5357097, 1.1057504, 0.4692918, -2.5357195, 1.1720763, 0.5547171, -2.69789],
    ("gns", 2): [1.1651136, 0.4033604, -2.5211099, 1.1684107, 0.4377821, -2.563027, 1.1304502, 0.62969, -2.740381],
}


@pytest.mark.parametrize(("kind", "features"), PINNED)
def test_outputs_equal_the_recorded_ones(kind, features):
    simulator = make_simulator(kind, dtype=torch.float64, features=features)
    # The weights follow a formula: random numbers may change between versions of torch.
    with torch.no_grad():
        for number, parameter in enumerate(simulator.parameters()):
            count = torch.arange(parameter.numel(), dtype=torch.float64)
            parameter.copy_((0.7 * torch.sin(1.3 * count + number)).reshape(parameter.shape))
    count = torch.arange(8, dtype=torch.float64)
    positions = torch.stack([0.05 * count.cos(), 0.05 * count.sin(), 0.52 + 0.01 * count], dim=1)
    displacements = 0.004 * torch.sin(torch.arange(96, dtype=torch.float64)).reshape(8, 4, 3)
    state = History(positions, positions.flip(1), displacements)
    # The surface's particles are a grid: samples may change between versions of trimesh.
    if kind == "gns":
        simulator.surface_particles.of = lambda surface: (
            torch.cartesian_prod(*[torch.arange(3) * 0.05] * 3) + torch.tensor([0, 0, 0.4])
        )
    out = predict(simulator, state, make_environment(ball(torch.float64), torch.float64))
    torch.testing.assert_close(
        out[[0, 3, 7], :].flatten(), torch.tensor(PINNED[kind, features]).double(), atol=1e-6, rtol=1e-6
    )


def test_node_features_of_surfsup_are_displacements_walls_distance_and_gradient():
    simulator = make_simulator("surfsup", radius=0.045)
    state = History(torch.tensor([[0.1, 0.05, 0.545], [0.49, 0.0, 1.9]]), torch.zeros(2, 3), torch.zeros(2, 4, 3))
    state.displacements[0, 0] = torch.tensor([1.9e-3, 0.0, -4.1e-3])
    features = simulator.network_input(state, make_environment(ball())).node_features
    expected = torch.zeros(2, 22)
    expected[0, 0], expected[0, 2] = 1.0, -1.0
    expected[:, 12:18] = 1.0
    expected[0, 16] = 1.0
    expected[1, 15], expected[1, 17] = 0.01 / 0.18, 0.1 / 0.18
    expected[0, 18:] = torch.tensor([0.045 / 0.09, 0, 0, 1])
    expected[1, 18] = 2.0
    torch.testing.assert_close(features, expected, atol=1e-5, rtol=0)


def test_node_features_of_version_1_have_walls_up_to_the_radius_and_the_gradient_everywhere():
    simulator = make_simulator("surfsup", radius=0.045, features=1)
    state = History(torch.tensor([[0.1, 0.05, 0.545], [0.49, 0.0, 1.9]]), torch.zeros(2, 3), torch.zeros(2, 4, 3))
    features = simulator.network_input(state, make_environment(ball())).node_features
    assert (features[:, 12:15] == 1).all() and (features[:, 16:18] == 1).all()
    assert float(features[1, 15]) == pytest.approx(0.01 / 0.045, abs=1e-5)
    torch.testing.assert_close(features[:, 19:], ball().distance_and_normal(state.positions)[1])


def test_the_gradient_fades_between_the_near_distance_and_the_largest_one():
    positions = torch.tensor([[0.1, 0.05, 0.5 + height] for height in (-0.1, 0.05, 0.09, 0.135, 0.18, 0.9)])
    state = History(positions, torch.zeros(6, 3), torch.zeros(6, 4, 3))
    features = make_simulator("surfsup").network_input(state, make_environment(ball())).node_features
    torch.testing.assert_close(features[:, 21], torch.tensor([1, 1, 1, 0.5, 0, 0]), atol=1e-5, rtol=0)


def test_a_surface_far_away_gives_the_features_of_no_surface():
    state = water(low=0.9)
    far, without = (
        make_simulator("surfsup").network_input(state, make_environment(surface)).node_features
        for surface in (ball(), None)
    )
    assert torch.equal(far, without)


def test_without_a_surface_the_distance_is_the_maximum():
    features = make_simulator("surfsup").network_input(water(), make_environment()).node_features
    assert torch.equal(features[:, 18:], torch.tensor([2.0, 0.0, 0.0, 0.0]).expand(40, 4))


def test_value_only_ignores_the_gradient_and_surfsup_does_not():
    for kind, ignores in (("value-only", True), ("surfsup", False)):
        simulator, state = make_simulator(kind), water()
        same = torch.equal(
            predict(simulator, state, make_environment(ball())),
            predict(simulator, state, make_environment(Twisted(ball()))),
        )
        assert same == ignores, kind


def test_no_sdf_ignores_the_surface_and_the_others_do_not():
    for kind in MESSAGE_PASSING:
        simulator, state = make_simulator(kind), water()
        same = torch.equal(
            predict(simulator, state, make_environment(ball())), predict(simulator, state, make_environment())
        )
        assert same == (kind == "no-sdf"), kind


def test_the_surface_particles_of_gns_stay_at_rest():
    simulator, environment = make_simulator("gns"), make_environment(ball())
    before = simulator.surface_particles.of(environment.surface).clone()
    states = [state for state, _ in simulator.rollout(water(), environment, 4)]
    assert all(len(state.positions) == 40 for state in states)
    nodes = simulator.nodes(states[-1], environment)
    assert torch.equal(nodes.positions[40:], before)
    assert len(before) == 150
    assert not nodes.displacements[40:].any()
    types = simulator.surface_features(nodes, environment)
    assert torch.equal(types[:40], torch.tensor([1.0, 0.0]).expand(40, 2))
    assert torch.equal(types[40:], torch.tensor([0.0, 1.0]).expand(150, 2))


def test_surface_particles_of_gns_are_nodes_of_its_graph():
    simulator, state = make_simulator("gns"), water(5)
    given = simulator.network_input(state, make_environment(ball()))
    neighbors = given.graph.neighbors
    assert len(neighbors.starts) - 1 == len(given.node_features) == 155
    assert ((neighbors.receivers < 5) & (neighbors.senders >= 5)).any()
    assert torch.equal(given.fluid_nodes, torch.arange(5))


@kinds
def test_a_batch_of_scenes_is_predicted_like_each_scene_alone(kind):
    simulator = make_simulator(kind, dtype=torch.float64)
    parts = [
        simulator.network_input(water(count, count, torch.float64), make_environment(surface, torch.float64))
        for count, surface in ((20, ball(torch.float64)), (7, None), (1, Sphere(0.4).double()))
    ]
    alone = torch.cat([simulator.predict_acceleration(part) for part in parts])
    torch.testing.assert_close(simulator.predict_acceleration(batch_inputs(parts)), alone)


@kinds
def test_the_target_leads_to_the_true_next_frame(kind):
    simulator, state = make_simulator(kind, dtype=torch.float64), water(dtype=torch.float64)
    displacement = 0.01 * torch.randn(40, 3).double()
    target = simulator.acceleration_target(state, displacement)
    assert target.shape == (40, 3)
    positions, velocities = simulator.integrate(state, target)
    torch.testing.assert_close(positions, state.positions + displacement)
    torch.testing.assert_close(velocities, displacement / FRAME_TIME)


@kinds
def test_from_a_noisy_state_the_target_corrects_the_displacement_alone(kind):
    simulator, state = make_simulator(kind, dtype=torch.float64), water(dtype=torch.float64)
    noisy = simulator.with_noise(state, 1e-3, torch.Generator().manual_seed(2))
    displacement = 0.01 * torch.randn(40, 3).double()
    positions, _ = simulator.integrate(noisy, simulator.acceleration_target(noisy, displacement))
    torch.testing.assert_close(positions - noisy.positions, displacement)


@kinds
def test_normalizers_are_measured_on_examples(kind):
    simulator = make_simulator(kind, dtype=torch.float64)
    examples = [(water(500, seed, torch.float64), 0.01 * torch.randn(500, 3).double()) for seed in (1, 2)]
    simulator.fit_normalizers(examples)
    targets = torch.cat([simulator.acceleration_target(*example) for example in examples])
    torch.testing.assert_close(targets.mean(dim=0), torch.zeros(3).double(), atol=1e-9, rtol=0)
    torch.testing.assert_close(targets.std(dim=0, correction=0), torch.ones(3).double())
    displacements = [simulator.displacement_normalizer.normalize(state.displacements) for state, _ in examples]
    torch.testing.assert_close(torch.cat(displacements).std(dim=(0, 1), correction=0), torch.ones(3).double())


@kinds
def test_a_network_that_predicts_gravity_alone_falls_freely(kind):
    simulator = make_simulator(kind, dtype=torch.float64)
    with torch.no_grad():
        for parameter in simulator.network.decoder[-1].parameters():
            parameter.zero_()
        simulator.acceleration_normalizer.mean.copy_(FRAME_TIME**2 * GRAVITY)
    environment = make_environment(ball(torch.float64), torch.float64)
    start, velocities = torch.tensor([[0.1, 0.1, 1.5]]).double(), torch.tensor([[0.5, 0.0, 0.3]]).double()
    rollout = simulator.rollout(simulator.initial_state(start, velocities, environment), environment, 8)
    for frame, (now, moved) in enumerate(rollout):
        # n frames of five solver steps h: n·5h·v + (5n)(5n+1)/2·h²·g
        steps, h = 5 * frame, FRAME_TIME / 5
        expected = start + steps * h * velocities + steps * (steps + 1) / 2 * h**2 * GRAVITY.double()
        torch.testing.assert_close(now.positions, expected, atol=1e-9, rtol=0)
        assert not moved.any()
    assert frame == 7


@kinds
def test_a_state_from_frames_is_like_an_initial_state(kind):
    simulator = make_simulator(kind)
    assert simulator.history_length == HISTORY_LENGTH
    positions, velocities = torch.randn(HISTORY_LENGTH + 1, 5, 3), torch.randn(HISTORY_LENGTH + 1, 5, 3)
    state = simulator.state_from_frames(positions, velocities)
    assert torch.equal(state.positions, positions[-1]) and torch.equal(state.velocities, velocities[-1])
    torch.testing.assert_close(state.displacements[:, -1], positions[1] - positions[0])
    initial = simulator.initial_state(positions[0], velocities[0], make_environment())
    assert initial.displacements.shape == state.displacements.shape


@kinds
def test_a_rollout_starts_with_the_start_and_repeats_bit_for_bit(kind):
    simulator, state = make_simulator(kind), water()
    runs = [list(simulator.rollout(state, make_environment(ball()), 5)) for _ in range(2)]
    assert [len(run) for run in runs] == [5, 5]
    assert runs[0][0][0] is state
    assert all(torch.equal(a.positions, b.positions) for (a, _), (b, _) in zip(*runs, strict=True))


@kinds
def test_collision_handling_keeps_every_frame_penetration_free_and_is_optional(kind):
    simulator, environment = make_simulator(kind), make_environment(ball())
    positions = torch.tensor([[0.1, 0.05, 0.56], [0.3, 0.1, 0.5]])
    state = simulator.initial_state(positions, torch.tensor([[0.0, 0.0, -8.0]] * 2), environment)
    kept = list(simulator.rollout(state, environment, 7))
    assert all((environment.surface.distance(now.positions) > 0).all() for now, _ in kept)
    assert any(moved.any() for _, moved in kept)
    free = list(simulator.rollout(state, environment, 7, handle_collisions=False))
    assert any((environment.surface.distance(now.positions) < 0).any() for now, _ in free)
    assert not any(moved.any() for _, moved in free)


def test_the_gradient_in_a_shape_parameter_equals_finite_differences():
    simulator, state = make_simulator("surfsup", dtype=torch.float64), water(15, dtype=torch.float64)

    def height(radius: torch.Tensor) -> torch.Tensor:
        environment = make_environment(Transformed(Sphere(radius), None, (0.1, 0.05, 0.25)).double(), torch.float64)
        now = state
        for _ in range(3):
            now, _ = simulator.step(now, environment, handle_collisions=False)
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
        {"width": True},
        {"layers": 101},
        {"features": 3},
    ],
)
def test_sizes_out_of_range_are_refused_by_name(sizes):
    with pytest.raises(ValueError, match=next(iter(sizes))):
        MessagePassingArchitecture(**sizes)


def test_the_default_size_is_that_of_the_paper():
    default = MessagePassingArchitecture()
    assert {"width": default.width, "layers": default.layers} == SIZES["paper"] == {"width": 128, "layers": 10}
    assert HISTORY_LENGTH == 4
    with pytest.raises(ValueError, match="surface_particles"):
        GnsArchitecture(surface_particles=0)
