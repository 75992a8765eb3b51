"""A scene begins no denser than at rest, and says so where its water is moved for that."""

import re
import warnings

import numpy as np
import pytest

from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.sph.start import MovedApartWarning, OmittedParticlesWarning

DAM = "container: {size: [0.9, 0.24, 0.9]}\nfluid: [{block: {min: [-0.45, -0.12, 0], max: [-0.21, 0.12, 0.48]}}]\n"
PADDLE = """
surfaces: {paddle: {box: {size: [0.1, 0.1, 0.3]}, at: [0, 0, 0.5], motion: {spin: {axis: [0, 0, 1], turns: 0.25}}}}
fluid: [{block: {min: [-0.2, -0.2, 0.3], max: [0.2, 0.2, 0.7]}}]
"""


def energies(simulation: Simulation, frames: int) -> list[float]:
    """Mean energy of the particles in each frame, J/kg."""
    found = []
    for _ in range(frames):
        frame = simulation.step()
        potential = -(frame.positions @ np.array(simulation.scene.gravity)).mean()
        found.append(float(potential + 0.5 * np.square(frame.velocities).sum(axis=1).mean()))
    return found


def block_at(x: float, y: float) -> Scene:
    """A block at the distances x and y from two walls, less the gap that a block keeps, far from all others."""
    block = f"fluid: [{{block: {{min: [{x - 0.3}, {y - 0.3}, 0.3], max: [0.1, 0.1, 0.5]}}}}]"
    return Scene.from_yaml(f"container: {{size: [0.6, 0.6, 1]}}\n{block}", "test")


@pytest.mark.parametrize(("x", "y"), [(0.02, 0.02), (0.006, 0.1), (0.1, 0.1)])
def test_water_far_from_walls_stays_where_it_is(x, y):
    scene = block_at(x, y)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        particles = Simulation(scene, device="cpu").particles
    np.testing.assert_array_equal(particles.positions, scene.initial_particles(None).positions)


def test_water_close_to_a_wall_is_moved_and_a_warning_says_how_far_and_how_to_keep_its_place():
    scene = block_at(0, 0)
    with pytest.warns(MovedApartWarning) as warned:
        particles = Simulation(scene, device="cpu").particles
    moved = np.linalg.norm(particles.positions - scene.initial_particles(None).positions, axis=1)
    says = re.search(r"by ([\d.]+) mm on average, ([\d.]+) mm at most; leave 49.5 mm", str(warned[0].message))
    assert says is not None
    assert [float(number) for number in says.groups()] == pytest.approx(
        [1000 * moved.mean(), 1000 * moved.max()], rel=0.03
    )


@pytest.mark.filterwarnings("ignore::surfsup.sph.start.MovedApartWarning")
def test_a_dam_that_fills_its_channel_breaks_without_gaining_energy():
    scene = Scene.from_yaml(DAM, "test")
    apart = energies(Simulation(scene, device="cpu"), 30)
    lattice = energies(Simulation(scene, device="cpu", particles=scene.initial_particles(None)), 30)
    assert max(apart) - apart[0] < 0.005
    assert max(lattice) - lattice[0] > 0.05


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_water_around_a_solid_that_is_going_to_move_begins_quietly():
    scene = Scene.from_yaml(PADDLE, "test")
    simulation = Simulation(scene)
    lattice = Simulation(scene, particles=scene.initial_particles(simulation.motion.solids.at_time(0)))
    speeds = [np.linalg.norm(one.step().velocities, axis=1).max() for one in (simulation, lattice)]
    assert speeds[0] < 0.1 < 0.2 < speeds[1]


def test_particles_of_a_file_keep_their_places(tmp_path):
    scene = block_at(0, 0)
    positions = scene.initial_particles(None).positions
    np.save(tmp_path / "water.npy", positions)
    from_file = Scene.from_yaml(
        "container: {size: [0.6, 0.6, 1]}\nfluid: [{particles: {file: water.npy}}]", "test", tmp_path
    )
    np.testing.assert_array_equal(Simulation(from_file, device="cpu").particles.positions, positions)


def test_particles_that_have_no_place_are_counted_in_a_warning():
    block = "fluid: [{block: {min: [-0.2, -0.2, 0.3], max: [0.2, 0.2, 0.6]}}]"
    ball = f"surface: {{sphere: {{radius: 0.1}}, at: [0, 0, 0.3]}}\n{block}"
    with pytest.warns(OmittedParticlesWarning, match=r"fluid: (\d+) particles that overlap the solid") as warned:
        simulation = Simulation(Scene.from_yaml(ball, "test"), device="cpu")
    omitted = [warning for warning in warned if warning.category is OmittedParticlesWarning]
    assert f"fluid: {simulation.particles.excluded} particles" in str(omitted[0].message)
