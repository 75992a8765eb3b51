"""Liquids that do not mix: particles of different masses."""

import copy
import pickle

import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import Block, Container, Fluid, Liquid, Scene
from surfsup.simulation import Simulation
from surfsup.sph.environment import Environment
from surfsup.sph.impulses import PARTICLE_VOLUME
from surfsup.sph.liquid import LiquidForces, Mixture
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import MixtureState, ParticleState, mixture_state

pytestmark = pytest.mark.skipif(not is_built(), reason="liquids need the C++ code")

WATER, OIL = Liquid(viscosity=0.001), Liquid(viscosity=0.001, density=600)
BOX = Container(size=(0.4, 0.4, 0.8))


def block(low: float, high: float, liquid: Liquid | None, half: float = 0.175) -> Fluid:
    return Fluid(block=Block((-half, -half, low), (half, half, high)), liquid=liquid)


def run(scene: Scene, frames: int) -> tuple[Simulation, list[sf.Frame]]:
    simulation = Simulation(scene)
    return simulation, [simulation.step() for _ in range(frames)]


def heights(frame: sf.Frame) -> tuple[float, float]:
    """Mean height of the first and of the second liquid."""
    first, second = (float(frame.positions[frame.liquids == number, 2].mean()) for number in (0, 1))
    return first, second


def test_oil_stays_on_water_and_the_floor_bears_the_weight_of_both():
    scene = Scene(container=BOX, fluid=[block(0.01, 0.17, WATER), block(0.17, 0.32, OIL)], forces="all")
    simulation, frames = run(scene, 320)
    last = frames[-1]
    masses = np.array([1000, 600])[last.liquids] * PARTICLE_VOLUME
    force = np.mean([frame.forces["container"].force[2] for frame in frames[220:]])
    assert -force == pytest.approx(9.81 * masses.sum(), rel=0.02)
    water, oil = (last.positions[last.liquids == number, 2] for number in (0, 1))
    assert np.quantile(water, 0.95) < np.quantile(oil, 0.05)
    assert np.linalg.norm(last.velocities, axis=1).mean() < 0.05
    assert simulation.state.crossings == 0


def test_a_box_of_oil_under_water_rises_and_one_of_the_same_density_stays():
    def risen(density: float) -> float:
        other = Liquid(density=density)
        fluid = [block(0.06, 0.24, other, half=0.12), block(0.01, 0.36, Liquid(), half=0.21)]
        _, frames = run(Scene(container=Container(size=(0.46, 0.46, 0.8)), fluid=fluid), 120)
        return heights(frames[-1])[0] - heights(frames[20])[0]

    assert risen(500) > 0.05 > 10 * abs(risen(1000.001))


def test_momentum_is_conserved_where_two_liquids_meet():
    slow = Fluid(block=Block((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), liquid=WATER)
    thrown = Block((-0.1, -0.1, 0.11), (0.1, 0.1, 0.25), velocity=(0.3, 0, -2))
    fast = Fluid(block=thrown, liquid=Liquid(viscosity=0.1, density=300, surface_tension=0.5))
    scene = Scene(container=Container(open=True), fluid=[slow, fast], gravity=(0, 0, 0))
    simulation, frames = run(scene, 20)
    masses = np.where(simulation.frame.liquids == 0, 1.0, 0.3)[:, None]
    before, after = ((masses * frame.velocities).sum(axis=0) for frame in (frames[0], frames[-1]))
    thrown_momentum = (masses * simulation.particles.velocities).sum(axis=0)
    np.testing.assert_allclose(before, thrown_momentum, atol=1e-4 * np.abs(thrown_momentum).max())
    np.testing.assert_allclose(after, thrown_momentum, atol=1e-4 * np.abs(thrown_momentum).max())
    energy = [float((masses * frame.velocities**2).sum()) for frame in frames]
    assert energy[-1] < 0.8 * energy[0]


def test_what_the_liquids_lose_the_solids_get():
    """Momentum of liquids, gravity and forces add up, also where the particles strike."""
    fluid = [block(0.1, 0.2, OIL), block(0.2, 0.3, WATER)]
    scene = Scene(container=BOX, fluid=fluid, forces="all")
    simulation = Simulation(scene)
    mass = np.array([0.6, 1.0])[simulation.frame.liquids][:, None] * 1000 * PARTICLE_VOLUME
    momentum, time = np.zeros(3), 0.005
    for _ in range(60):
        frame = simulation.step()
        momentum += time * (mass.sum() * np.array(scene.gravity) - frame.forces["container"].force)
        np.testing.assert_allclose((mass * frame.velocities).sum(axis=0), momentum, atol=2e-3 * mass.sum())


def test_two_liquids_that_are_the_same_flow_as_one():
    almost = Liquid(viscosity=0.001, density=1000.0001)
    parts = [block(0.05, 0.15, WATER), block(0.15, 0.25, almost)]
    whole = [entry.model_copy(update={"liquid": None}) for entry in parts]
    _, mixed = run(Scene(container=BOX, fluid=parts), 12)
    _, one = run(Scene(container=BOX, fluid=whole, liquid=WATER), 12)
    np.testing.assert_allclose(mixed[-1].positions, one[-1].positions, atol=2e-5)


def test_an_entry_without_a_liquid_has_that_of_the_scene_or_the_solvers_own():
    own = Simulation(Scene(container=BOX, fluid=[block(0.05, 0.15, OIL), block(0.15, 0.25, None)]))
    assert own.scene.mixture == (OIL, Liquid()) and own.scene.needs_native
    with pytest.raises(InputError, match=r"^viscosity: the scene has several liquids"):
        own.set_viscosity(0.1)
    of_scene = Scene(container=BOX, fluid=[block(0.05, 0.15, OIL), block(0.15, 0.25, None)], liquid="honey")
    assert of_scene.mixture[1].density == 1420 and LiquidForces.of_scene(of_scene).masses == (600 / 1420, 1.0)


def test_a_tap_pours_oil_on_water():
    tap = sf.Tap(disc={"radius": 0.05}, at=(0, 0, 0.5), speed=1.0, liquid=OIL)
    scene = Scene(container=BOX, fluid=[block(0.01, 0.1, WATER)], taps=[tap])
    simulation, frames = run(scene, 60)
    last = frames[-1]
    assert (last.liquids == (last.ids >= len(simulation.particles.positions))).all() and last.liquids.any()
    assert len(last.liquids) == len(last.positions)


def test_water_settles_under_oil():
    text = """
container: {size: [0.4, 0.4, 0.6]}
surface: {bowl: {capture_radius: 0.17, wall: 0.02}, at: [0, 0, 0.2]}
fluid:
  - {fill: {below: 0.12, seed: [0, 0, 0.1], settle: true}}
  - {fill: {surface: {sphere: {radius: 0.05}, at: [0, 0, 0.35]}}, liquid: oil}
"""
    simulation = Simulation(Scene.from_yaml(text, "test"))
    particles = simulation.particles
    assert sorted(set(particles.liquids)) == [0, 1] and len(particles.liquids) == len(particles.positions)
    assert particles.positions[particles.liquids == 1, 2].min() > 0.28


def test_the_coefficients_can_be_copied_although_their_native_form_cannot():
    mixture = Mixture.of((WATER, OIL), 1000)
    assert [each.mass for each in mixture.native] == pytest.approx([1, 0.6])
    assert copy.deepcopy(mixture) == mixture and pickle.loads(pickle.dumps(mixture)) == mixture


def test_a_state_that_does_not_know_its_liquids_is_refused():
    environment = Environment.of(Scene(container=BOX, fluid=[block(0.05, 0.15, OIL), block(0.15, 0.25, None)]), None)
    positions = torch.tensor([[0.0, 0.0, 0.2], [0.0, 0.0, 0.23]])
    state = ParticleState(positions, torch.zeros_like(positions))
    with pytest.raises(
        InputError, match=r"^the scene has several liquids, which this use of the solver does not know$"
    ):
        DfsphSolver().step(state, environment)
    known = mixture_state(state, np.array([0, 1]))
    assert isinstance(DfsphSolver().step(known, environment)[0], MixtureState)
    assert len(known.rows(torch.tensor([1])).liquids) == 1


def test_warp_does_not_know_several_liquids():
    environment = Environment.of(Scene(container=BOX, fluid=[block(0.05, 0.15, OIL), block(0.15, 0.25, None)]), None)
    positions = torch.tensor([[0.0, 0.0, 0.2], [0.0, 0.0, 0.23]], requires_grad=True)
    state = mixture_state(ParticleState(positions, torch.zeros(2, 3)), np.array([0, 1]))
    with pytest.raises(InputError, match=r"^several liquids run in the C\+\+ code only"):
        DfsphSolver().step(state, environment)


def test_taps_that_are_opened_later_have_liquids_of_the_scene():
    simulation = Simulation(Scene(container=BOX, fluid=[block(0.01, 0.1, None), block(0.12, 0.2, OIL)]))
    tap = sf.Tap(disc={"radius": 0.05}, at=(0, 0, 0.5), speed=1.0, liquid=OIL)
    simulation.set_taps([tap])
    last = [simulation.step() for _ in range(12)][-1]
    assert last.liquids[-1] == 1 and len(last.liquids) == len(last.ids) > len(simulation.particles.positions)
    with pytest.raises(InputError, match=r"has a liquid that the scene does not have$"):
        simulation.set_taps([sf.Tap(disc={"radius": 0.05}, at=(0, 0, 0.5), speed=1.0, liquid="honey")])
