import numpy as np
import pytest

import surfsup as sf
from surfsup import Block, InputError, Scene, Simulation, Sphere, Transformed

BALL = Transformed(Sphere(0.2), translation=(0, 0, 0.2))
SCENES = [Scene(surface=BALL, fluid=[Block((-0.1, -0.1, z), (0.1, 0.1, z + 0.2))]) for z in (0.5, 0.6, 0.45)]


def simulations():
    return [Simulation(scene, device="cpu") for scene in SCENES]


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_world_gives_what_it_gives_alone(threads):
    worlds = sf.Worlds(simulations(), threads)
    frames = worlds.step(40)
    for frame, simulation in zip(frames, simulations(), strict=True):
        alone = [simulation.step() for _ in range(40)][-1]
        assert frame.time == alone.time
        np.testing.assert_array_equal(frame.positions, alone.positions)
        np.testing.assert_array_equal(frame.velocities, alone.velocities)


def test_worlds_return_to_their_states():
    worlds = sf.Worlds(simulations())
    worlds.step(3)
    states = worlds.states
    later = worlds.step(2)
    worlds.reset(states)
    for one, other in zip(later, worlds.step(2), strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
    worlds.reset()
    assert [world.time for world in worlds] == [0, 0, 0]
    assert len(worlds) == 3
    assert worlds[1].scene is SCENES[1]


def test_what_cannot_be_is_refused_in_one_line():
    (one, *_) = simulations()
    for bad, threads in (([], 1), ([one, one], 1), ([one], 0)):
        with pytest.raises(InputError, match=r"^worlds: ") as error:
            sf.Worlds(bad, threads)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="1 worlds are reset to as many states, not to 2"):
        sf.Worlds([one]).reset([one.state, one.state])


def test_a_scene_is_no_list_of_simulations():
    with pytest.raises(InputError, match=r"give a list of simulations, such as \[Simulation"):
        sf.Worlds(SCENES[0])
