"""Liquids in Warp: as in C++, momentum is conserved, and what is missing is refused in one line."""

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from tests.sph.test_impulses import PADDLE, SOLIDS, WATER
from tests.sph.test_moving import simulation_of
from tests.sph.warp_engine.test_moving import in_warp
from tests.sph.warp_engine.test_solver import needs_cpp

SHAKEN = "motion: {keyframes: [{time: 0}, {time: 0.3, rotation: {axis: [0, 1, 0], degrees: 25}}]}"
LIQUIDS = {
    "honey": "honey",
    "water with tension": "{surface_tension: 0.072, adhesion: 0.05}",
    "oil that slips": "{viscosity: 0.001, friction: 0.1}",
    "all": "{viscosity: 0.0005, surface_tension: 0.05, adhesion: 0.1, density: 900}",
}


@needs_cpp
@pytest.mark.parametrize("liquid", LIQUIDS.values(), ids=LIQUIDS)
@pytest.mark.parametrize("extra", ["", PADDLE])
def test_each_frame_equals_that_in_cpp(liquid, extra):
    text = f"liquid: {liquid}\n{SOLIDS}{extra}{WATER % -2}"
    one, other = simulation_of(text), in_warp(text)
    for number in range(21):
        before = one.state
        here = one.step()
        if number % 5 == 0:
            other.reset(before)
            there = other.step()
            np.testing.assert_allclose(there.positions, here.positions, atol=1e-6)
            np.testing.assert_allclose(there.velocities, here.velocities, atol=2e-3)
            for name, wrench in here.forces.items():
                np.testing.assert_allclose(there.forces[name].force, wrench.force, rtol=2e-3, atol=0.1)


@needs_cpp
def test_a_rollout_of_fifty_frames_of_oil_in_a_tilted_container_equals_that_in_cpp():
    text = (
        f"liquid: {{viscosity: 0.01, surface_tension: 0.03}}\ncontainer: {{size: [0.5, 0.3, 0.5], {SHAKEN}}}\n"
        "fluid: [{block: {min: [-0.18, -0.08, 0.06], max: [0.18, 0.08, 0.14]}}]"
    )
    one, other = simulation_of(text), in_warp(text)
    for _ in range(50):
        here, there = one.step(), other.step()
    np.testing.assert_allclose(there.positions, here.positions, atol=1e-5)


def test_momentum_of_liquid_and_solids_changes_by_gravity_alone():
    """The implicit viscosity conserves it, where the solver's own does not."""
    simulation = in_warp(
        f"liquid: {{viscosity: 0.01, adhesion: 0.1, surface_tension: 0.05}}\n{SOLIDS}{PADDLE}{WATER % -2}"
    )
    state, environment = simulation.state.fluid, simulation._environment
    state = ParticleState(state.positions.double(), state.velocities.double())
    solver, pushed = DfsphSolver(), 0.0
    for number in range(12):
        measured = environment.at_frame(number).measured()
        before, (state, _) = state.velocities.sum(dim=0), solver.step(state, measured)
        change = state.velocities.sum(dim=0) - before - len(state.positions) * 0.005 * environment.gravity
        pushed += np.abs(measured.impulses.rows[:, :3]).sum()
        np.testing.assert_allclose(-change.numpy(), measured.impulses.rows[:, :3].sum(axis=0), atol=1e-5)
    assert pushed > 100


def test_what_is_missing_is_refused():
    mixture = in_warp(
        "container: {size: [0.4, 0.4, 0.5]}\nliquid: oil\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.05], max: [0.1, 0.1, 0.15]}, liquid: water},"
        " {block: {min: [-0.1, -0.1, 0.2], max: [0.1, 0.1, 0.3]}}]"
    )
    with pytest.raises(InputError, match=r"several liquids run in the C\+\+ code only.*or give one liquid"):
        mixture.step()
    honey = in_warp("liquid: honey\nfluid: [{block: {min: [-0.1, -0.1, 0.05], max: [0.1, 0.1, 0.15]}}]")
    state = honey.state.fluid
    with pytest.raises(InputError, match="a liquid has no gradients; omit 'liquid'"):
        DfsphSolver().step(ParticleState(state.positions.requires_grad_(), state.velocities), honey._environment)
