import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import Block, Container, Fluid, Liquid, Scene
from surfsup.scene.fluid import InitialParticles
from surfsup.simulation import Simulation
from surfsup.sph.liquid import LiquidForces
from surfsup.splishsplash import solver
from surfsup.splishsplash.job_files import materials

OIL, WATER = Liquid(viscosity=0.01, density=600, surface_tension=0.03), Liquid(viscosity=0.01)
LOWER, UPPER = Block((-0.13, -0.13, 0.01), (0.13, 0.13, 0.15)), Block((-0.13, -0.13, 0.15), (0.13, 0.13, 0.29))
SCENE = Scene(
    container=Container(size=(0.3, 0.3, 0.5)),
    fluid=[
        Fluid(block=UPPER, liquid=Liquid(viscosity=0.01, density=1000)),
        Fluid(block=LOWER, liquid=Liquid(viscosity=0.01, density=600)),
    ],
    frames=60,
)


def test_every_liquid_is_a_material_with_its_density():
    scene = Scene(fluid=[Fluid(block=LOWER, liquid=OIL), Fluid(block=UPPER, liquid=WATER)])
    oil, water = materials(LiquidForces.of_scene(scene))
    assert (oil["id"], oil["density0"], water["id"], water["density0"]) == ("Fluid 000", 600, "Fluid 001", 1000)
    # The acceleration is the coefficient times the mass of the neighbors.
    tension, alone = oil["Akinci et al. 2013"], LiquidForces.of(OIL)
    assert tension["surfaceTension"] == pytest.approx(alone.surface_tension / 0.6)
    assert oil["Weiler et al. 2018"]["viscosity"] == alone.viscosity and "Akinci et al. 2013" not in water


def test_a_liquid_without_particles_is_refused():
    start = InitialParticles([LOWER.positions()], [(0, 0, 0)], 0, (False,), (0,))
    with pytest.raises(InputError, match=r"^liquid 1 has no particles"):
        next(solver.simulate(SCENE, None, start))


@pytest.mark.skipif(not is_built(), reason="liquids need the C++ code")
def test_heavy_on_light_turns_over_as_in_the_reference():
    """The order of the particles is that of the scene, not that of the reference's fluids."""
    try:
        solver.check_installed()
    except InputError as missing:
        pytest.skip(str(missing))
    start = SCENE.initial_particles(None)
    mixed = np.arange(len(start.positions)) % 2  # every second particle is of the other liquid
    every = InitialParticles([start.positions], [start.velocities], 0, (False,), (mixed,))
    first, _ = next(solver.simulate(SCENE, None, every))
    np.testing.assert_allclose(first, start.positions, atol=1e-6)
    *_, (expected, _) = solver.simulate(SCENE, None, start)
    *_, found = Simulation(SCENE).run()
    for number in (0, 1):
        here = start.liquids == number
        way = np.linalg.norm(expected[here] - start.positions[here], axis=1).mean()
        assert np.linalg.norm(found.positions[here] - expected[here], axis=1).mean() < 0.15 * way
