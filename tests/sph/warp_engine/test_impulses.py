"""Forces of the water on solids in Warp: as in C++, and momentum is conserved."""

import numpy as np
import pytest
import torch

from surfsup.native.dispatch import is_built
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from tests.sph.test_impulses import PADDLE, SOLIDS, WATER
from tests.sph.test_moving import simulation_of
from tests.sph.warp_engine.test_moving import in_warp
from tests.sph.warp_engine.test_solver import needs_cpp

SHAKEN = "container: {size: [0.5, 0.5, 1], motion: {spin: {axis: [0, 1, 0], rate: 0.5}}}"


@needs_cpp
@pytest.mark.parametrize(
    "text",
    [
        SOLIDS + WATER % -2,
        SOLIDS + PADDLE + WATER % -12,
        (SOLIDS + PADDLE + WATER % -2).replace("container: {size: [0.5, 0.5, 1]}", SHAKEN),
    ],
)
def test_forces_and_torques_equal_those_in_cpp(text):
    one, other = simulation_of(text), in_warp(text)
    largest = dict.fromkeys(one.scene.solid_names, 0.0)
    for _ in range(25):
        other.reset(one.state)
        here, there = one.step().forces, other.step().forces
        assert list(here) == list(there)
        for name, wrench in here.items():
            largest[name] = max(largest[name], np.abs(wrench.force).max())
            np.testing.assert_allclose(there[name].force, wrench.force, rtol=1e-3, atol=0.05)
            np.testing.assert_allclose(there[name].torque, wrench.torque, rtol=1e-3, atol=0.02)
    assert min(largest.values()) > 5


@pytest.mark.parametrize("extra", ["", PADDLE])
def test_momentum_closes_to_rounding_where_no_particle_has_neighbors(extra):
    """Viscosity between particles alone does not conserve it; here every contact is with a solid or a wall."""
    simulation = in_warp(SOLIDS + extra + WATER % -2)
    random = torch.Generator().manual_seed(2)
    positions = torch.rand(4000, 3, generator=random, dtype=torch.float64) * 0.9 * torch.tensor([0.5, 0.5, 0.4])
    positions += torch.tensor([-0.225, -0.225, 0.022])
    environment = simulation._environment.at_frame(0)
    kept: list[int] = []
    solids = [environment.surface, *(solid.at(solid.pose(0.0)) for solid in simulation.motion.solids.moving)]
    far = torch.stack([solid.distance(positions.float()) > 0.0205 for solid in solids]).all(dim=0)
    for number in torch.nonzero(far)[:, 0].tolist():
        if not kept or torch.linalg.vector_norm(positions[kept] - positions[number], dim=1).min() > 0.13:
            kept.append(number)
    velocities = torch.tensor([9.0, -7.0, -22.0], dtype=torch.float64).repeat(len(kept), 1)
    state, solver = ParticleState(positions[kept], velocities), DfsphSolver()
    measured = environment.measured()
    after, collided = solver.step(state, measured)
    change = (after.velocities - state.velocities).sum(dim=0) - len(kept) * 0.005 * environment.gravity
    assert len(kept) > 20 and collided.sum() > 2 and np.abs(measured.impulses.rows[:, :3]).max() > 1
    np.testing.assert_allclose(-change.numpy(), measured.impulses.rows[:, :3].sum(axis=0), atol=1e-6)


def test_the_water_does_not_notice_that_forces_are_recorded():
    text = SOLIDS + WATER % -2
    with_forces, without = in_warp(text), in_warp(text.replace("forces: all\n", ""))
    for _ in range(15):
        here, there = with_forces.step(), without.step()
    np.testing.assert_allclose(here.positions, there.positions, atol=1e-6)


def test_a_body_floats_in_warp_as_in_cpp():
    text = (
        "container: {size: [0.4, 0.4, 0.6]}\nsurfaces:\n"
        "  boat: {box: {size: [0.16, 0.16, 0.12]}, at: [0, 0, 0.3], rigid_body: {density: 500}}\n"
        "fluid: [{block: {min: [-0.19, -0.19, 0.01], max: [0.19, 0.19, 0.2]}}]\n"
    )
    heights = []
    for simulation in (in_warp(text), *([simulation_of(text)] if is_built() else [])):
        for _ in range(25):
            frame = simulation.step()
        heights.append(frame.poses["boat"].position[2])
    assert 0.2 < heights[0] < 0.3
    np.testing.assert_allclose(heights, heights[0], atol=1e-4)
