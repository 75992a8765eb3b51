"""Values from Python that no simulation can have are refused in one line; nothing is computed from them."""

import numpy as np
import pytest
import torch

import surfsup as sf

WATER = [sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.56))]
# Not finite, beyond single precision, no numbers.
HOSTILE = [float("nan"), float("inf"), 1e39, np.float64(-1e300), 10**400, "a", [1], torch.tensor([1.0, 2.0])]
NAMED = """
surfaces: {ball: {sphere: {radius: 0.1}, at: [0, 0, 0.2]}}
fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.56]}}]
"""

MADE = {
    "block": lambda x: sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, x)),
    "velocity": lambda x: sf.Scene(fluid=[sf.Block((0, 0, 0), (1, 1, 1), velocity=(0, 0, x))]),
    "container": lambda x: sf.Container(size=(1, 1, x)),
    "gravity": lambda x: sf.Scene(fluid=WATER, gravity=(0, 0, x)),
    "particle_radius": lambda x: sf.Scene(fluid=WATER, particle_radius=x),
    "sphere": lambda x: sf.Sphere(x),
    "box": lambda x: sf.Box((x, 0.1, 0.1)),
    "torus": lambda x: sf.Torus(0.1, x),
    "translation": lambda x: sf.Transformed(sf.Sphere(0.1), translation=(0, 0, x)),
    "rotation": lambda x: sf.Transformed(sf.Sphere(0.1), rotation=x),
    "scale": lambda x: sf.Transformed(sf.Sphere(0.1), scale=x),
    "pose": lambda x: sf.Pose.of((0, 0, x)),
    "quaternion": lambda x: sf.Pose.of((0, 0, 0), x),
}
CALLED = {
    "set_pose": lambda simulation, x: simulation.set_pose("ball", (0, 0, x)),
    "set_gravity": lambda simulation, x: simulation.set_gravity((0, 0, x)),
    "set_viscosity": lambda simulation, x: simulation.set_viscosity(x),
    "reset": lambda simulation, x: simulation.reset(x),
    "fps": lambda simulation, x: list(simulation.run(0.01, x)),
    "seconds": lambda simulation, x: list(simulation.run(x)) if not isinstance(x, int | float) or x != x else refuse(),
}


def refuse():
    raise sf.InputError("a long run is not tried here")


@pytest.mark.parametrize("value", HOSTILE, ids=lambda value: str(value)[:20])
@pytest.mark.parametrize("name", MADE)
def test_nothing_is_made_of_it(name, value):
    with pytest.raises(sf.InputError) as error:
        MADE[name](value)
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def simulation():
    return sf.Simulation(sf.Scene.from_yaml(NAMED, "test"), device="cpu")


@pytest.mark.parametrize("value", HOSTILE, ids=lambda value: str(value)[:20])
@pytest.mark.parametrize("name", CALLED)
def test_a_simulation_does_not_take_it(simulation, name, value):
    with pytest.raises(sf.InputError) as error:
        CALLED[name](simulation, value)
    assert "\n" not in str(error.value)
    assert np.isfinite(simulation.frame.positions).all()
