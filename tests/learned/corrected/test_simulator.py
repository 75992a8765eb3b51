import math

import pytest
import torch

from surfsup.learned.corrected.features import (
    DENSITY_SCALE,
    GRADIENT_SCALE,
    NEIGHBORHOOD_FEATURES,
    PARTICLE_FEATURES,
    VELOCITY_SCALE,
    neighborhood_features,
    particle_features,
)
from surfsup.learned.corrected.simulator import CorrectedArchitecture, CorrectedSimulator, join_observations
from surfsup.scene import FRAME_TIME
from surfsup.sdf import Sphere
from surfsup.sph.boundary.density import plane_fraction, solid_density
from surfsup.sph.energy import MAX_ENERGY_GAIN, energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.solver import DfsphSolver, Observation
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS, ParticleState

GRAVITY = torch.tensor([0.0, 0.0, -9.81])


def environment_of(surface=None, dtype=torch.float32, gravity=GRAVITY) -> Environment:
    lower, upper = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
    return Environment(surface, lower.to(dtype), upper.to(dtype), gravity.to(dtype))


def simulator_of(seed: int = 0, dtype=torch.float32, std: float = 0.5, **sizes: int) -> CorrectedSimulator:
    """A simulator with random weights; the small initial decoder would hide most faults."""
    torch.manual_seed(seed)
    simulator = CorrectedSimulator(CorrectedArchitecture(**{"width": 8, "layers": 2, **sizes})).to(dtype)
    torch.nn.init.normal_(simulator.network.decoder[-1].weight, std=std)
    return simulator


def water(count: int = 60, seed: int = 0, dtype=torch.float32, low: float = 1.0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype) * 0.2 + torch.tensor([0, 0, low], dtype=dtype)
    return ParticleState(positions, torch.randn(count, 3, generator=random, dtype=dtype))


def observed(positions: list[list[float]], velocities: list[list[float]], environment: Environment) -> Observation:
    return DfsphSolver().observe(ParticleState(torch.tensor(positions), torch.tensor(velocities)), environment)


def test_an_untrained_simulator_is_close_to_the_solver():
    torch.manual_seed(0)
    state, environment = water(), environment_of()
    simulator = CorrectedSimulator(CorrectedArchitecture())
    after, _ = simulator.step(state, environment)
    solver, _ = DfsphSolver().step(state, environment)
    assert (after.positions - solver.positions).abs().max() < 1e-4
    assert (after.velocities - solver.velocities).abs().max() < 0.05


def test_with_weights_of_zero_it_is_the_solver():
    state, environment, simulator = water(), environment_of(), simulator_of(std=0.0)
    after, _ = simulator.step(state, environment)
    solver, _ = DfsphSolver().step(state, environment)
    torch.testing.assert_close(after.positions, solver.positions, atol=1e-6, rtol=0)
    torch.testing.assert_close(after.velocities, solver.velocities, atol=1e-6, rtol=0)


def test_the_order_of_particles_does_not_matter():
    state, environment = water(dtype=torch.float64), environment_of(None, torch.float64)
    simulator, order = simulator_of(dtype=torch.float64), torch.randperm(60)
    shuffled = ParticleState(*(value[order] for value in vars(state).values()))
    straight, _ = simulator.step(state, environment)
    permuted, _ = simulator.step(shuffled, environment)
    torch.testing.assert_close(permuted.positions, straight.positions[order])
    torch.testing.assert_close(permuted.velocities, straight.velocities[order])


def test_several_scenes_in_one_pass_are_corrected_as_alone():
    simulator = simulator_of(dtype=torch.float64)
    sideways = torch.tensor([1.0, 0.0, -5.0])
    environments = [environment_of(None, torch.float64), environment_of(Sphere(0.9).double(), torch.float64, sideways)]
    observations = [
        simulator.observe(water(count, count, torch.float64), environment)
        for count, environment in zip((30, 12), environments, strict=True)
    ]
    joined = simulator.correct(join_observations(observations))
    alone = [simulator.correct(one) for one in observations]
    torch.testing.assert_close(joined.velocity, torch.cat([one.velocity for one in alone]))
    torch.testing.assert_close(joined.position, torch.cat([one.position for one in alone]))


@pytest.mark.parametrize("use_native", [True, False])
def test_no_weights_make_the_water_gain_energy(use_native):
    environment = environment_of()
    for seed in range(5):
        simulator = simulator_of(seed, std=100.0)
        if not use_native:
            simulator.solver.native = None
        state = water(800, seed)
        for _ in range(3):
            after, _ = simulator.step(state, environment)
            after = after.detach()
            assert energy_gain(state, after.positions, after.velocities, GRAVITY) <= MAX_ENERGY_GAIN
            state = after


def test_any_network_leaves_free_fall_alone():
    positions = torch.cartesian_prod(*[torch.arange(5) * 0.03] * 3).double() + torch.tensor([0.0, 0.0, 1.0])
    velocities = torch.tensor([0.5, -0.2, -2.0], dtype=torch.float64).expand_as(positions)
    state, environment = ParticleState(positions, velocities), environment_of(dtype=torch.float64)
    simulator = simulator_of(dtype=torch.float64)
    for _ in range(10):
        state, _ = simulator.step(state, environment)
        for _ in range(SUBSTEPS):
            velocities = velocities + SUBSTEP_TIME * GRAVITY.double()
            positions = positions + SUBSTEP_TIME * velocities
    torch.testing.assert_close(state.positions, positions, atol=1e-9, rtol=0)
    torch.testing.assert_close(state.velocities, velocities, atol=1e-7, rtol=0)


def test_the_gradients_of_the_weights_equal_finite_differences():
    simulator = simulator_of(dtype=torch.float64, std=0.02)  # small enough for corrections within the bound
    state, environment = water(40, dtype=torch.float64), environment_of(None, torch.float64)

    weights = torch.randn(40, 3, dtype=torch.float64)

    def loss() -> torch.Tensor:
        return (weights * simulator.correct(simulator.observe(state, environment)).velocity).sum()

    loss().backward()
    weight = simulator.network.layers[0].mix.weight
    direction, step = torch.randn_like(weight), 1e-3
    with torch.no_grad():
        expected = (weight.grad * direction).sum()
        weight += step * direction
        above = loss()
        weight -= 2 * step * direction
        below = loss()
    assert expected.abs() > 1e-8
    torch.testing.assert_close(expected, (above - below) / (2 * step), rtol=1e-4, atol=1e-11)


@pytest.mark.parametrize("use_native", [True, False])
def test_features_beside_a_solid_are_the_documented_columns(use_native):
    solver = DfsphSolver()
    if not use_native:
        solver.native = None
    # Slow enough to stay at its distance of 0.02 m.
    state = ParticleState(torch.tensor([[0.0, 0.0, 0.32]]), torch.tensor([[0.0, 0.0, -1e-3]]))
    observation = solver.observe(state, environment_of(Sphere(0.3), gravity=torch.zeros(3)))
    features, neighborhood = particle_features(observation), neighborhood_features(observation)
    assert (features.shape, neighborhood.shape) == ((1, PARTICLE_FEATURES), (1, NEIGHBORHOOD_FEATURES))
    distance = torch.tensor(0.02)
    solid, slope = (float(value) for value in solid_density(distance, plane_fraction(distance)))
    slope /= KERNEL_SUPPORT
    expected = torch.zeros(PARTICLE_FEATURES)
    expected[0:3] = observation.delta_velocity[0] / VELOCITY_SCALE
    expected[3:6] = observation.delta_position[0] / (FRAME_TIME * VELOCITY_SCALE)
    expected[8] = -slope / GRADIENT_SCALE  # density decreases upward
    assert 1 / math.pi + solid > 1  # compressed, but a solid without a map sets the rest density at the start
    velocity = -float(observation.substep.density_rate[0]) / slope
    assert 5e-5 < velocity < 5e-4  # the solver has reversed the approach
    expected[13] = -velocity * slope * FRAME_TIME / DENSITY_SCALE
    torch.testing.assert_close(features[0], expected, atol=2e-3, rtol=1e-3)
    torch.testing.assert_close(neighborhood[0], torch.tensor([0, 0, 0, 0, 0, solid]), atol=1e-4, rtol=0)


@pytest.mark.parametrize("drift", [[0.0, 0.0, 0.0], [5.0, -3.0, 2.0]])
def test_features_depend_on_relative_velocities_alone(drift):
    positions = [[0.0, 0.0, 1.0], [0.03, 0.0, 1.0]]
    velocities = [drift, [drift[0], drift[1] + 0.06, drift[2]]]
    observation = observed(positions, velocities, environment_of())
    features = particle_features(observation)
    # Kernel value 1/4 at half the support, relative velocity 0.06 m/s across, slowed by viscosity alone.
    assert features[0, 10] == pytest.approx(0.25 * 0.06 / VELOCITY_SCALE, rel=0.03)
    assert features[1, 10] == pytest.approx(-0.25 * 0.06 / VELOCITY_SCALE, rel=0.03)
    assert neighborhood_features(observation)[0, 0] == pytest.approx(0.25, abs=1e-3)
