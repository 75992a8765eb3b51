import copy
import pickle

import numpy as np
import pytest
import torch

from surfsup import native
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import FRAME_TIME, SPACING, Container, Liquid, Scene
from surfsup.sdf import Box, Sphere, Surface, Transformed
from surfsup.simulation import Simulation
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.dfsph import SELF_DENSITY, VISCOSITY_SOFTENING
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline, cubic_spline_gradient
from surfsup.sph.liquid import VISCOSITY_FACTOR, LiquidForces
from surfsup.sph.native_solver import NativeSolver
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS, ParticleState

pytestmark = pytest.mark.skipif(not is_built(), reason="liquids need the C++ code")

every_isa = pytest.mark.parametrize("isa", native.instruction_sets())


def environment_of(liquid: Liquid, surface: Surface | None = None) -> Environment:
    corner = torch.full((3,), 1.0)
    boundary_map = None if surface is None else BoundaryMap.of(surface, Container(size=(2.0, 2.0, 2.0)))
    return Environment(surface, -corner, corner, torch.zeros(3), boundary_map, liquid=LiquidForces.of(liquid))


def lattice(side: int, spacing: float = SPACING) -> torch.Tensor:
    axis = spacing * (torch.arange(side) - (side - 1) / 2)
    return torch.cartesian_prod(axis, axis, axis)


def disordered(side: int = 6, seed: int = 0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = lattice(side) + 0.003 * torch.randn(side**3, 3, generator=random)
    return ParticleState(positions, torch.randn(side**3, 3, generator=random))


def spinning(positions: torch.Tensor, rate: float) -> torch.Tensor:
    return torch.linalg.cross(torch.tensor([0.0, 0.0, rate]).expand_as(positions), positions)


def viscous_frame(positions: np.ndarray, velocities: np.ndarray, viscosity: float) -> tuple[np.ndarray, np.ndarray]:
    """A frame in which viscosity alone acts, by the formula of surfsup.sph.liquid with dense matrices."""
    count, volume = len(positions), SPACING**3
    for _ in range(SUBSTEPS):
        apart = positions[:, None] - positions[None]
        distance = np.linalg.norm(apart, axis=-1)
        q = distance / KERNEL_SUPPORT
        peak = SELF_DENSITY / volume
        density = volume * peak * cubic_spline(q).sum(axis=1)
        safe = np.where(distance > 0, distance, 1)
        slope = np.where(distance > 0, peak * cubic_spline_gradient(q) / KERNEL_SUPPORT / safe, 0)
        pair = 10 * viscosity * volume * slope / (distance**2 + VISCOSITY_SOFTENING * KERNEL_SUPPORT**2)
        pair /= density[:, None] * density[None]
        blocks = pair[..., None, None] * apart[..., :, None] * apart[..., None, :]
        matrix = -blocks
        matrix[np.arange(count), np.arange(count)] += blocks.sum(axis=1)
        laplacian = matrix.transpose(0, 2, 1, 3).reshape(3 * count, 3 * count)
        system = np.eye(3 * count) - SUBSTEP_TIME * laplacian
        velocities = np.linalg.solve(system, velocities.ravel()).reshape(-1, 3)
        positions = positions + SUBSTEP_TIME * velocities
    return positions, velocities


@every_isa
@pytest.mark.parametrize("viscosity", [0.01, 1.0, 100.0])
def test_a_frame_equals_the_formula_where_viscosity_alone_acts(isa, viscosity):
    random = torch.Generator().manual_seed(1)
    positions = lattice(4, 0.04)
    # It expands so fast that no pair approaches, so there is no pressure.
    velocities = 8 * positions + 0.05 * torch.randn(64, 3, generator=random)
    frame = NativeSolver(isa).step(
        ParticleState(positions, velocities), environment_of(Liquid(viscosity=viscosity)), handle_collisions=False
    )
    expected = viscous_frame(positions.double().numpy(), velocities.double().numpy(), VISCOSITY_FACTOR * viscosity)
    np.testing.assert_allclose(frame.velocities.numpy(), expected[1], atol=1e-3)
    np.testing.assert_allclose(frame.positions.numpy(), expected[0], atol=5e-6)
    assert np.abs(expected[1] - velocities.numpy()).max() > (0.003 if viscosity < 1 else 0.2)


@pytest.mark.parametrize(
    "liquid", [Liquid(viscosity=0.5), Liquid(viscosity=20.0), Liquid(viscosity=0.02, surface_tension=20.0)]
)
def test_momentum_is_conserved_to_rounding(liquid):
    state = disordered()
    frame = NativeSolver().step(state, environment_of(liquid), handle_collisions=False)
    before, after = (velocities.double().sum(dim=0) for velocities in (state.velocities, frame.velocities))
    torch.testing.assert_close(after, before, rtol=0, atol=2e-3)  # of 340 m/s; 1.02e-3 with the sanitized build


def test_viscosity_conserves_angular_momentum_and_lets_a_rigid_rotation_be():
    positions = lattice(6)
    inside = positions[positions.norm(dim=1) < 0.09]
    state = ParticleState(inside, spinning(inside, 2.0))
    frame = NativeSolver().step(state, environment_of(Liquid(viscosity=50.0)), handle_collisions=False)
    moments = [
        torch.linalg.cross(x, v).sum(dim=0)
        for x, v in ((inside, state.velocities), (frame.positions, frame.velocities))
    ]
    torch.testing.assert_close(moments[1], moments[0], rtol=2e-3, atol=1e-4)
    torch.testing.assert_close(frame.velocities, spinning(frame.positions, 2.0), rtol=0, atol=4e-3)


def test_a_very_viscous_liquid_moves_like_a_solid_at_once():
    state = disordered()
    frame = NativeSolver().step(state, environment_of(Liquid(viscosity=100.0)), handle_collisions=False)
    spread = [(v - v.mean(dim=0)).norm(dim=1).mean() for v in (state.velocities, frame.velocities)]
    assert spread[1] < 0.12 * spread[0]


def slid(friction: float) -> torch.Tensor:
    """Velocities, one frame later, of particles that slide along the top of a box at 1 m/s."""
    box = Transformed(Box((0.6, 0.6, 0.4)), None, (0.0, 0.0, -0.2))
    positions = lattice(3)[::3] + torch.tensor([0.0, 0.0, 0.06])
    state = ParticleState(positions, torch.tensor([1.0, 0.0, 0.0]).expand(9, 3).contiguous())
    environment = environment_of(Liquid(viscosity=1.0, friction=friction), box)
    return NativeSolver().step(state, environment).velocities


def test_friction_stops_what_slides_and_without_it_the_liquid_slips():
    assert slid(0.0)[:, 0].mean() == pytest.approx(1.0, abs=0.005)
    assert slid(0.2)[:, 0].max() < 0.8
    assert slid(1.0)[:, 0].max() < 0.4
    assert slid(1.0).abs()[:, 1].max() < 0.05


def test_adhesion_pulls_towards_a_solid_and_nowhere_else():
    ball = Sphere(0.2)
    positions = torch.tensor([[0.235, 0.0, 0.0], [0.0, 0.28, 0.0]])
    state = ParticleState(positions, torch.zeros(2, 3))
    frame = NativeSolver().step(state, environment_of(Liquid(adhesion=5.0), ball))
    assert frame.velocities[0, 0] < -0.01 and frame.velocities[0, 1:].abs().max() < 1e-3
    assert not frame.velocities[1].any()


def test_surface_tension_rounds_a_cube():
    scene = Scene(
        container=Container(open=True),
        gravity=(0, 0, 0),
        fluid=[{"block": {"min": (0, 0, 0), "max": (0.27, 0.27, 0.27)}}],
    )
    reach = {}
    for tension in (0.0, 60.0):
        liquid = Liquid(viscosity=0.02, surface_tension=tension)
        simulation = Simulation(scene.model_copy(update={"liquid": liquid}))
        for _ in range(80):
            frame = simulation.step()
        reach[tension] = np.linalg.norm(frame.positions - frame.positions.mean(axis=0), axis=1).max()
    assert reach[0.0] == pytest.approx(np.sqrt(3) * 0.105, rel=0.02)
    assert reach[60.0] < 0.9 * reach[0.0]


@pytest.mark.parametrize("friction", [0.0, 1.0])
def test_a_solid_that_moves_drags_the_liquid_by_friction_alone(friction):
    plate = {
        "box": {"size": [0.8, 0.4, 0.1]},
        "at": [0, 0, 0.05],
        "motion": {"keyframes": [{"time": 0, "position": [0, 0, 0.05]}, {"time": 1, "position": [0.5, 0, 0.05]}]},
    }
    scene = Scene.model_validate(
        {
            "container": {"size": [2, 1, 1]},
            "surfaces": {"plate": plate},
            "fluid": [{"block": {"min": [-0.15, -0.15, 0.12], "max": [0.15, 0.15, 0.25]}}],
            "liquid": {"viscosity": 0.5, "friction": friction},
        }
    )
    simulation = Simulation(scene)
    for _ in range(60):
        before, frame = simulation.frame, simulation.step()
    speed = (frame.poses["plate"].position[0] - before.poses["plate"].position[0]) / FRAME_TIME
    assert speed > 0.5
    assert frame.velocities[:, 0].mean() == pytest.approx(friction * speed, abs=0.05)


def test_forces_hold_what_friction_and_adhesion_take():
    scene = Scene.model_validate(
        {
            "container": {"size": [0.4, 0.4, 1]},
            "surfaces": {"ball": {"sphere": {"radius": 0.08}, "at": [0.05, 0, 0.1]}},
            "fluid": [{"block": {"min": [-0.15, -0.15, 0.25], "max": [0.15, 0.15, 0.45], "velocity": [0.5, 0, -2]}}],
            "liquid": {"viscosity": 0.2, "surface_tension": 5, "adhesion": 5},
            "forces": "all",
        }
    )
    simulation = Simulation(scene)
    mass = 1000 * SPACING**3
    momentum = mass * simulation.frame.velocities.astype(float).sum(axis=0)
    count = len(simulation.frame.positions)
    sideways = 0.0
    for _ in range(60):
        frame = simulation.step()
        taken = sum(wrench.force for wrench in frame.forces.values())
        momentum += FRAME_TIME * (count * mass * np.array([0, 0, -9.81]) - taken)
        sideways += abs(taken[0])
    found = mass * frame.velocities.astype(float).sum(axis=0)
    np.testing.assert_allclose(found, momentum, atol=2e-3)
    assert sideways > 1


def step_of(threads: int, isa: str | None = None) -> torch.Tensor:
    torch.set_num_threads(threads)
    try:
        liquid = Liquid(viscosity=2.0, surface_tension=10.0, adhesion=5.0)
        ball = Transformed(Sphere(0.2), None, (0.0, 0.0, -0.33))
        return NativeSolver(isa).step(disordered(9), environment_of(liquid, ball)).positions
    finally:
        torch.set_num_threads(1)


def test_the_result_does_not_depend_on_threads():
    assert torch.equal(step_of(1), step_of(3))


@every_isa
def test_every_instruction_set_gives_the_same_to_rounding(isa):
    torch.testing.assert_close(step_of(1, isa), step_of(1, "plain"), rtol=0, atol=3e-6)


def test_a_liquid_without_properties_is_the_solver_s_own_water():
    assert LiquidForces.of(None) is None and LiquidForces.of(Liquid(density=800)) is None
    state = disordered(5)
    plain, liquid = (DfsphSolver().step(state, environment_of(Liquid()))[0] for _ in range(2))
    assert torch.equal(plain.positions, liquid.positions)


def test_a_denser_liquid_has_less_tension_for_its_mass():
    light, dense = (LiquidForces.of(Liquid(surface_tension=2.0, adhesion=1.0, density=d)) for d in (500, 2000))
    assert light.surface_tension == pytest.approx(4 * dense.surface_tension)
    assert light.adhesion == pytest.approx(4 * dense.adhesion)


def test_learned_simulators_refuse_a_liquid():
    scene = Scene(fluid=[{"block": {"min": (0, 0, 1), "max": (0.2, 0.2, 1.2)}}], liquid="honey")
    with pytest.raises(InputError, match="knows no liquid but water as the solver has it; use the simulator dfsph"):
        Simulation(scene, simulator="surfsup")


def test_environments_with_a_liquid_can_be_copied_and_pickled():
    environment = environment_of(Liquid(viscosity=1.0))
    assert environment.liquid.native is not None
    for copied in (copy.deepcopy(environment), pickle.loads(pickle.dumps(environment))):
        assert copied.liquid == environment.liquid


def test_the_scene_of_honey_flows_alike_at_every_size():
    """Twice as large, with particles twice as large and a viscosity 2^1.5 times as large: the same flow."""
    found = []
    for size in (1.0, 4.0):
        scene = Scene.model_validate(
            {
                "particle_radius": 0.015 * size,
                "container": {"size": [size, size, size]},
                "fluid": [{"block": {"min": [0, 0, 0.1 * size], "max": [0.2 * size, 0.2 * size, 0.3 * size]}}],
                "liquid": {"viscosity": 0.1 * size**1.5, "surface_tension": 10 * size**2},
            }
        )
        simulation = Simulation(scene)
        for _ in range(30):
            frame = simulation.step()
        found.append(frame.positions / np.float32(size))
    np.testing.assert_array_equal(*found)
