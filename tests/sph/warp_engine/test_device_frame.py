"""What a GPU needs of a frame: the host does not wait within it, and its launches can be recorded and replayed."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
import warp as wp

from surfsup.sdf import Sphere, Transformed, load_siren
from surfsup.sph.environment import Environment, surface_on
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from surfsup.sph.warp_engine.solver import Room, WarpSolver
from tests.learned.simulated_gpu import simulated_gpu, waits
from tests.sph.warp_engine.test_moving import SCENES, in_warp
from tests.sph.warp_engine.test_solver import (
    BALL,
    environment_of,
    falling_block,
    impact,
    needs_cpp,
    solid,
    splash,
)


@pytest.fixture
def reads_at_the_end(monkeypatch):
    """The host's waits within frames and at their ends, apart from each other."""
    found = {"within": [], "at the end": []}
    original, numpy = Room.was_enough, wp.array.numpy

    def was_enough(*arguments):
        found["within"] += waits
        waits.clear()
        enough = original(*arguments)
        found["at the end"] += waits
        waits.clear()
        return enough

    monkeypatch.setattr(Room, "was_enough", was_enough)
    monkeypatch.setattr(wp.array, "numpy", lambda array: waits.append("numpy") or numpy(array))
    waits.clear()
    return found


def on(device: torch.device, state: ParticleState, environment: Environment) -> tuple[ParticleState, Environment]:
    there = replace(
        environment, **{name: getattr(environment, name).to(device) for name in ("lower", "upper", "gravity")}
    )
    return ParticleState(state.positions.to(device), state.velocities.to(device)), there


@pytest.mark.parametrize("with_map", [True, False])
def test_the_host_waits_at_the_end_of_a_frame_alone(with_map, reads_at_the_end):
    state = impact(torch.float32)
    expected = WarpSolver().step(state, environment_of(BALL, with_map))
    with torch.no_grad(), simulated_gpu() as gpu:
        surface = Transformed(Sphere(torch.tensor(0.3)), None, (0.0, 0.0, 0.3)).to(gpu)
        there, environment = on(gpu, state, replace(environment_of(BALL, with_map), surface=surface))
        environment.on_host  # noqa: B018  # once for an environment
        waits.clear()
        solver = WarpSolver()
        solver.step(there, environment)
        reads_at_the_end["at the end"].clear()
        found = solver.step(there, environment)
        torch.testing.assert_close(found[0].cpu(), expected[0], atol=1e-6, rtol=0)
    assert reads_at_the_end["within"] == []
    assert len(reads_at_the_end["at the end"]) == 2


@needs_cpp
@pytest.mark.parametrize("with_map", [True, False])
@pytest.mark.parametrize("name", ["mesh", "heightfield"])
def test_frames_on_triangles_equal_those_in_cpp_and_the_host_does_not_wait(name, with_map, reads_at_the_end):
    # Without a map the normals count further from the solid. Beside an edge two faces are equally near in the single
    # precision of both searches, and their normals differ by 0.001.
    tolerance = 1e-6 if with_map else 2e-5
    surface = solid(name)
    state = falling_block(0.32 if name == "heightfield" else 0.63)
    in_cpp, solver, environment = DfsphSolver(), WarpSolver(), environment_of(surface, with_map)
    with torch.no_grad():
        with simulated_gpu() as gpu:
            _, on_gpu = on(gpu, state, replace(environment, surface=surface_on(surface, gpu)))
        for number in range(50):
            expected, _ = in_cpp.step(state, environment)
            if number % 5 == 0:  # the simulated GPU is slow
                with simulated_gpu() as gpu:
                    there, _ = on(gpu, state, on_gpu)
                    positions, velocities, _ = solver.step(there, on_gpu)
                    if number == 0:  # copies the container's corners to the host
                        reads_at_the_end["within"].clear()
                    torch.testing.assert_close(positions.cpu(), expected.positions, atol=tolerance, rtol=0)
                    torch.testing.assert_close(velocities.cpu(), expected.velocities, atol=1e3 * tolerance, rtol=0)
                    waits.clear()
            state = expected
    assert reads_at_the_end["within"] == []


def test_the_host_does_not_wait_for_a_network_either(reads_at_the_end):
    state = impact(torch.float32)
    surface = Transformed(load_siren(Path("coral")), None, (0.0, 0.0, 0.3), 0.4)
    with torch.no_grad():
        expected = WarpSolver().step(state, environment_of(surface))
        with simulated_gpu() as gpu:
            on_gpu = replace(environment_of(surface), surface=surface_on(surface, gpu))
            there, environment = on(gpu, state, on_gpu)
            solver = WarpSolver()
            solver.step(there, environment)
            reads_at_the_end["within"].clear()
            found = solver.step(there, environment)
            torch.testing.assert_close(found[0].cpu(), expected[0], atol=1e-6, rtol=0)
    assert reads_at_the_end["within"] == []


def test_the_host_waits_at_the_end_of_a_frame_with_gradients_alone(reads_at_the_end):
    state = impact(torch.float32)
    with simulated_gpu() as gpu:
        radius = torch.tensor(0.3).to(gpu).requires_grad_()
        surface = Transformed(Sphere(0.3), None, (0.0, 0.0, 0.3)).to(gpu)
        surface.surface.radius = radius
        there, environment = on(gpu, state, replace(environment_of(BALL, False), surface=surface))
        environment.on_host  # noqa: B018
        waits.clear()
        positions, _, collided = WarpSolver().step(there, environment)
        (gradient,) = torch.autograd.grad(positions.sum(), radius)
        assert waits == []
        assert collided.cpu().any() and gradient.cpu().abs() > 0
    assert reads_at_the_end["within"] == []


def test_a_recorded_frame_is_replayed_for_every_state():
    environment, solver, graphs = environment_of(BALL), WarpSolver(), []
    for seed in range(3):
        state = splash(100, seed, dtype=torch.float32)
        positions, velocities, _ = solver.step(state, environment)
        graphs.append(solver._device_frame.graph)
        expected = WarpSolver().step(state, environment)
        assert torch.equal(positions, expected[0]) and torch.equal(velocities, expected[1])
    assert graphs[0] is None and graphs[1] is not None and graphs[1] is graphs[2]


@pytest.mark.parametrize("change", ["count", "precision", "environment"])
def test_a_frame_of_another_kind_is_recorded_anew(change):
    environment, solver, state = environment_of(BALL), WarpSolver(), splash(100, dtype=torch.float32)
    solver.step(state, environment)
    if change == "count":
        state = splash(90, dtype=torch.float32)
    elif change == "precision":
        state, environment = splash(100), environment_of(BALL, dtype=torch.float64)
    else:
        environment = environment_of(None)
    found, expected = solver.step(state, environment), WarpSolver().step(state, environment)
    assert torch.equal(found[0], expected[0])


def test_a_result_is_not_overwritten_by_the_next_frame():
    environment, solver = environment_of(BALL), DfsphSolver()
    solver.native = None
    first, _ = solver.step(splash(100, dtype=torch.float32), environment)
    kept = first.positions.clone()
    solver.step(first, environment)
    assert torch.equal(first.positions, kept)


@pytest.mark.parametrize("liquid", ["", "liquid: {viscosity: 0.001, surface_tension: 0.05}\n"])
def test_the_host_waits_at_the_end_of_a_frame_alone_where_solids_move(liquid, reads_at_the_end, monkeypatch):
    monkeypatch.setattr("surfsup.sph.warp_engine.liquid.MAX_ITERATIONS", 12)  # the simulated GPU is slow
    simulation = in_warp(liquid + SCENES["a paddle and a ball"])
    state, environment = simulation.state.fluid, simulation._environment.at_frame(0)
    expected = WarpSolver().step(state, environment)
    with torch.no_grad(), simulated_gpu() as gpu:
        there, on_gpu = on(gpu, state, replace(environment, surface=surface_on(environment.surface, gpu)))
        on_gpu.on_host  # noqa: B018
        waits.clear()
        solver = WarpSolver()
        for _ in range(2):
            found = solver.step(there, on_gpu)
            torch.testing.assert_close(found[0].cpu(), expected[0], atol=1e-6, rtol=0)
            waits.clear()
    assert reads_at_the_end["within"] == []
