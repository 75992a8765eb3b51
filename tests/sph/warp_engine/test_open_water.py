"""Taps and drains in Warp: a number of particles that varies, with and without gradients."""

import numpy as np
import pytest
import torch

from surfsup.evaluation.metrics import kd_tree, max_density
from surfsup.sph.open_water import OpenState, WithTaps
from surfsup.sph.state import ParticleState
from tests.sph.test_moving import simulation_of
from tests.sph.warp_engine.test_moving import in_warp
from tests.sph.warp_engine.test_solver import needs_cpp

MOVES = (
    "motion: {between: linear, keyframes: [{time: 0, position: [-0.1, 0, 0.4]}, {time: 1, position: [-0.1, 1, 0.4]}]}"
)
SCENE = (
    "container: {size: [0.6, 0.6, 0.6]}\n"
    f"surfaces: {{arm: {{box: {{size: [0.05, 0.05, 0.05]}}, {MOVES}}}}}\n"
    "taps: [{disc: {radius: 0.05}, at: [0.1, 0, 0], direction: [1, 0, 0], speed: 2, carrier: arm}]\n"
    "drains: [{box: {size: [0.3, 0.6, 0.2]}, at: [0.25, 0, 0.1]}]\n"
    "fluid: [{block: {min: [-0.25, -0.2, 0.06], max: [0.1, 0.2, 0.16], velocity: [1, 0, 0]}}]"
)


@needs_cpp
def test_a_tap_on_a_solid_that_moves_and_a_drain_are_as_in_cpp():
    one, other = simulation_of(SCENE), in_warp(SCENE)
    for _ in range(25):
        here, there = one.step(), other.step()
        np.testing.assert_array_equal(here.ids, there.ids)
        np.testing.assert_allclose(here.positions, there.positions, atol=1e-5)
    assert here.ids.max() > len(here.ids)  # some came, some left


def test_a_tap_under_water_pushes_it_aside():
    simulation = in_warp(
        "container: {size: [0.4, 0.4, 0.8]}\n"
        "fluid: [{block: {min: [-0.19, -0.19, 0.01], max: [0.19, 0.19, 0.2]}}]\n"
        "taps: [{disc: {radius: 0.06}, at: [0, 0, 0.02], direction: [0, 0, 1], speed: 2, from: 0.02}]"
    )
    frames = list(simulation.run(seconds=0.25))
    # The layer that comes first compresses the water for a frame.
    assert np.mean([max_density(kd_tree(frame.positions)) < 1.1 for frame in frames[10::2]]) > 0.8
    assert frames[-1].positions[:, 2].mean() > frames[4].positions[:, 2].mean()


def test_gradients_live_with_particles_that_come_and_leave():
    simulation = in_warp(SCENE)
    solver, environment, start = simulation._simulator, simulation._environment, simulation.state.fluid
    assert isinstance(solver, WithTaps) and isinstance(start, OpenState)
    positions, velocities = (value.double() for value in (start.positions, start.velocities))

    def end(shift: torch.Tensor) -> torch.Tensor:
        """Of all that is in the scene in the end, where a part of the start was shifted and sped up."""
        fluid = ParticleState(positions + shift[:3], velocities + 10 * shift[3:])
        state = OpenState(fluid, start.ids, start.next_id)
        for number in range(15):
            state, _ = solver.step(state, environment.at_frame(number))
        assert state.ids.max() > len(state.ids) and len(state.ids) != len(start.ids)
        weights = torch.sin(torch.arange(3 * len(state.ids), dtype=torch.float64)).view(-1, 3)
        return (weights * (state.positions + 0.1 * state.velocities)).sum()

    shift = torch.zeros(6, dtype=torch.float64, requires_grad=True)
    (found,) = torch.autograd.grad(end(shift), shift)
    step = 1e-8
    with torch.no_grad():
        differences = [
            (end(shift + step * unit) - end(shift - step * unit)) / (2 * step) for unit in torch.eye(6).double()
        ]
    assert found.tolist() == pytest.approx([float(value) for value in differences], rel=1e-3, abs=1e-3)
