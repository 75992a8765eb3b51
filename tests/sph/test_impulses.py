"""Forces of the fluid on solids: momentum is conserved, units and names are right, and the water does not notice."""

import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup import native
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.sph.impulses import PARTICLE_VOLUME
from surfsup.sph.native_solver import NativeSolver, solver_parameters
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import FramePart

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
every_isa = pytest.mark.parametrize("isa", native.instruction_sets())

WATER = "fluid: [{block: {min: [-0.2, -0.2, 0.33], max: [0.2, 0.2, 0.48], velocity: [0, 0, %g]}}]\n"
SOLIDS = (
    "container: {size: [0.5, 0.5, 1]}\nforces: all\nsurfaces:\n"
    "  ball: {sphere: {radius: 0.1}, at: [0.05, 0, 0.2]}\n"
    "  step: {box: {size: [0.1, 0.5, 0.1]}, at: [-0.2, 0, 0.05]}\n"
)
PADDLE = "  paddle: {box: {size: [0.3, 0.04, 0.1]}, at: [0, -0.1, 0.06], motion: {spin: {turns: 2}}}\n"


def scene(text):
    return Scene.from_yaml(text, "test")


def without_viscosity(isa=None):
    """A solver whose forces between particles conserve momentum exactly, and whose energy limiter never acts."""

    class Inviscid(NativeSolver):
        def _solver(self, part):
            kept = solver_parameters(part)
            before = kept.viscosity, kept.max_energy_gain
            kept.viscosity, kept.max_energy_gain = 0.0, 1e9
            try:
                return native.Solver(kept)
            finally:
                kept.viscosity, kept.max_energy_gain = before

    solver = DfsphSolver()
    solver.native = Inviscid(isa)
    return solver


def momenta(frame, mass):
    return mass * frame.velocities.astype(np.float64).sum(axis=0)


@every_isa
@pytest.mark.parametrize("text", [SOLIDS + WATER % -2, SOLIDS + PADDLE + WATER % -2, SOLIDS + WATER % -30])
def test_momentum_of_water_and_solids_changes_by_gravity_alone(text, isa):
    simulation = sf.Simulation(scene(text), without_viscosity(isa))
    mass = 1000 * PARTICLE_VOLUME
    weight = len(simulation.particles.positions) * mass * np.array([0, 0, -9.81])
    before, pushed = momenta(simulation.frame, mass), 0.0
    for _ in range(15):
        frame = simulation.step()
        forces = sum(wrench.force for wrench in frame.forces.values())
        after = momenta(frame, mass)
        pushed += np.abs(forces).sum() * 0.005
        # Rounding of single precision in velocities of up to 30 m/s.
        np.testing.assert_allclose(after - before + 0.005 * forces, 0.005 * weight, atol=2e-4)
        before = after
    assert pushed > 3  # N s


def test_viscosity_between_particles_costs_little_momentum():
    simulation = sf.Simulation(scene(SOLIDS + WATER % -2))
    mass = 1000 * PARTICLE_VOLUME
    weight = len(simulation.particles.positions) * mass * np.array([0, 0, -9.81])
    for _ in range(100):
        simulation.step()
    start, impulse = momenta(simulation.frame, mass), np.zeros(3)
    for _ in range(100):
        frame = simulation.step()
        impulse += 0.005 * (weight - sum(wrench.force for wrench in frame.forces.values()))
    change = momenta(frame, mass) - start
    assert np.abs(change - impulse).max() < 0.005 * 0.5 * np.linalg.norm(weight)


@pytest.mark.parametrize("extra", ["", PADDLE])
def test_the_water_does_not_notice_that_forces_are_recorded(extra):
    text = SOLIDS + extra + WATER % -2
    with_forces = sf.Simulation(scene(text))
    without = sf.Simulation(scene(text.replace("forces: all\n", "")))
    for _ in range(25):
        here, there = with_forces.step(), without.step()
        assert list(here.forces) == ["container", "ball", "step", *(["paddle"] if extra else [])]
        assert not there.forces
    np.testing.assert_array_equal(here.positions, there.positions)
    np.testing.assert_array_equal(here.velocities, there.velocities)


def test_forces_do_not_depend_on_the_number_of_threads():
    def forces(threads):
        count = torch.get_num_threads()
        torch.set_num_threads(threads)
        try:
            simulation = sf.Simulation(scene(SOLIDS + WATER % -2))
            for _ in range(20):
                frame = simulation.step()
            return frame.forces["ball"].force
        finally:
            torch.set_num_threads(count)

    np.testing.assert_array_equal(forces(1), forces(2))


def test_the_torque_is_about_the_origin_of_the_solid():
    shifted = "{union: [{sphere: {radius: 0.1}, at: [0.2, -0.1, 0]}], at: [-0.15, 0.1, 0.2]}"
    plain = sf.Simulation(scene(SOLIDS + WATER % -2))
    moved = sf.Simulation(scene((SOLIDS + WATER % -2).replace("{sphere: {radius: 0.1}, at: [0.05, 0, 0.2]}", shifted)))
    size = 0.0
    for _ in range(25):
        ball, other = plain.step().forces["ball"], moved.step().forces["ball"]
        size = max(size, np.abs(ball.force).max())
        np.testing.assert_allclose(other.force, ball.force, rtol=1e-3, atol=1e-2)
        np.testing.assert_allclose(ball.torque, 0, atol=1e-2)  # every force on a ball passes through its middle
        np.testing.assert_allclose(other.torque, np.cross([0.2, -0.1, 0], other.force), atol=1e-2)
    assert size > 20


def test_forces_grow_with_the_cube_of_the_size_and_with_density():
    small = sf.Simulation(scene(SOLIDS + WATER % -2))
    text = (
        "particle_radius: 0.06\ndensity: 1250\ncontainer: {size: [2, 2, 4]}\nforces: [step]\nsurfaces:\n"
        "  ball: {sphere: {radius: 0.4}, at: [0.2, 0, 0.8]}\n"
        "  step: {box: {size: [0.4, 2, 0.4]}, at: [-0.8, 0, 0.2]}\n"
        "fluid: [{block: {min: [-0.8, -0.8, 1.32], max: [0.8, 0.8, 1.92], velocity: [0, 0, -4]}}]"
    )
    large = sf.Simulation(scene(text))
    for _ in range(40):
        here, there = small.step().forces["step"], large.step().forces
        assert list(there) == ["step"]
        np.testing.assert_allclose(there["step"].force, 64 * 1.25 * here.force, rtol=1e-3, atol=0.5)
        np.testing.assert_allclose(there["step"].torque, 256 * 1.25 * here.torque, rtol=1e-3, atol=0.5)
    assert abs(here.force[2]) > 5


def test_of_several_solids_that_stand_still_each_has_its_own_force():
    simulation = sf.Simulation(
        scene(
            "container: {size: [2, 1, 1]}\nforces: all\nsurfaces:\n"
            "  under: {box: {size: [0.6, 0.6, 0.1]}, at: [-0.5, 0, 0.05]}\n"
            "  dry: {box: {size: [0.6, 0.6, 0.1]}, at: [0.7, 0, 0.05]}\n"
            "fluid: [{block: {min: [-0.65, -0.15, 0.12], max: [-0.35, 0.15, 0.4]}}]"
        )
    )
    weight = len(simulation.particles.positions) * 1000 * PARTICLE_VOLUME * 9.81
    for _ in range(20):
        forces = simulation.step().forces
    assert forces["under"].force[2] < -0.5 * weight
    np.testing.assert_array_equal(forces["dry"].force, 0)


def test_a_solid_that_starts_to_move_keeps_its_name():
    simulation = sf.Simulation(scene(SOLIDS + WATER % -2))
    for _ in range(15):
        simulation.step()
    simulation.set_pose("ball", (0.05, 0, 0.21))
    forces = simulation.step().forces
    assert forces["ball"].force[2] < 0 and simulation.motion.solids.moving[0].name == "ball"


def test_frames_between_steps_have_the_mean_force_since_the_frame_before():
    simulation = sf.Simulation(scene(SOLIDS + WATER % -2))
    steps = [simulation.step().forces["ball"].force for _ in range(25)]
    simulation.reset()
    frames = list(simulation.run(seconds=0.125, fps=60))
    assert not frames[0].forces
    for number, frame in enumerate(frames[1:], start=1):
        edges = np.clip([(number - 1) * 10 / 3, number * 10 / 3] - np.arange(25)[:, None], 0, 1)
        mean = (np.diff(edges, axis=1) * steps).sum(axis=0) / (10 / 3)
        np.testing.assert_allclose(frame.forces["ball"].force, mean, rtol=1e-9, atol=1e-9)


def test_simulators_without_forces_refuse():
    with pytest.raises(InputError, match="computes no forces on solids; use the simulator dfsph"):
        sf.Simulation(scene(SOLIDS + WATER % -2), "surfsup")


def test_a_part_of_a_frame_has_its_own_parameters():
    assert solver_parameters(FramePart(0.001)).frame_time == pytest.approx(0.001)
    assert solver_parameters().viscosity > 0  # the inviscid solver of these tests changed nothing for others
