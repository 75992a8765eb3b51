import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.datasets.generation.physical_check import (
    DENSITY_INTERVAL,
    PenetrationCheck,
    PhysicalCheck,
    UnphysicalError,
)
from surfsup.scene import FRAME_TIME, Scene
from surfsup.scene.solids import build_solids
from surfsup.sdf import Sphere, Surface

SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\n"
    "fluid: [{block: {min: [-0.1, -0.1, 1.0], max: [0.1, 0.1, 1.2]}}]",
    "test",
)
FRAMES = 2 * DENSITY_INTERVAL


def fall() -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (frames, 3, N) of a block in free fall that ends above the ball."""
    start = SCENE.initial_particles(None).positions.T.astype(float)
    times = FRAME_TIME * np.arange(FRAMES)[:, None, None]
    gravity = np.array(SCENE.gravity)[:, None]
    velocities = np.broadcast_to(times * gravity, (FRAMES, *start.shape))
    return start + 0.5 * times**2 * gravity, velocities.copy()


def message_of(positions: np.ndarray, velocities: np.ndarray) -> str | None:
    """What is found, which must not depend on how many frames are looked at chunk."""
    found = set()
    for chunk in (1, 7, FRAMES):
        check = PhysicalCheck(SCENE, build_solids(SCENE))
        try:
            for first in range(0, FRAMES, chunk):
                check.check(positions[first : first + chunk], velocities[first : first + chunk])
        except UnphysicalError as error:
            found.add(str(error))
        else:
            found.add(None)
    (message,) = found
    return message


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ((0.0, 0.0, 1.0), None),
        ((np.nan, 0.0, 1.0), "a position or velocity is not finite"),
        ((0.6, 0.0, 1.0), "a particle left the container"),
        ((0.0, 0.0, -0.01), "a particle left the container"),
        ((0.0, 0.0, 2.01), "a particle left the container"),
        ((0.0, 0.0, 0.59), "a particle was 0.01 m inside the solid"),
    ],
)
def test_a_particle_at_an_impossible_place_is_an_error(place, message):
    positions, velocities = fall()
    positions[30, :, 5] = place
    assert message_of(positions, velocities) == message


def test_a_velocity_that_is_not_finite_is_an_error():
    positions, velocities = fall()
    velocities[30, 1, 2] = np.inf
    assert message_of(positions, velocities) == "a position or velocity is not finite"


@pytest.mark.parametrize(("speed", "message"), [(20.0, None), (31.0, "a particle flew at 31 m/s")])
def test_a_particle_may_move_by_its_diameter_in_a_substep(speed, message):
    """The other particles stop, so that no energy is gained."""
    positions, velocities = fall()
    velocities[45:] = 0
    velocities[45:, 0, 0] = speed
    found = message_of(positions, velocities)
    assert found is None if message is None else found.startswith(message)


def test_water_may_lose_energy_but_not_gain_it():
    positions, velocities = fall()
    slower = velocities.copy()
    slower[30:] *= 0.9
    assert message_of(positions, slower) is None
    velocities[30:, 0] += 0.4
    assert message_of(positions, velocities) == "the fluid gained 0.08 J/kg, where it can only lose: it burst"


@pytest.mark.parametrize(("scale", "message"), [(0.99, None), (0.97, "the fluid was 1.1 times as dense as at rest")])
def test_compressed_water_is_an_error(scale, message):
    """A scale of 0.97 makes the density inside 1.096."""
    positions, velocities = fall()
    middle = positions.mean(axis=2, keepdims=True)
    positions[DENSITY_INTERVAL] = (middle + scale * (positions - middle))[DENSITY_INTERVAL]
    found = message_of(positions, velocities)
    assert found is None if message is None else found.startswith(message)


class CountedBall(Surface):
    """A ball that counts its distance queries."""

    def __init__(self) -> None:
        super().__init__()
        self.ball, self.queries = Sphere(0.2), 0

    def distance(self, points: torch.Tensor) -> torch.Tensor:
        self.queries += len(points)
        return self.ball.distance(points)

    def bounds(self) -> torch.Tensor:
        return self.ball.bounds()


@given(seed=st.integers(0, 10_000), step=st.floats(0.001, 0.2), chunk=st.integers(1, 9))
def test_every_penetration_is_found(seed, step, chunk):
    random = np.random.default_rng(seed)
    steps = random.normal(scale=step, size=(60, 3, 4))
    positions = np.array([0.5, 0.3, 0.2])[:, None] + steps.cumsum(axis=0)
    depth = 0.2 - np.linalg.norm(positions, axis=1).min()
    surface = CountedBall()
    penetration = PenetrationCheck(surface)
    try:
        for first in range(0, 60, chunk):
            penetration.check(positions[first : first + chunk])
    except UnphysicalError:
        assert depth > -1e-6
    else:
        assert depth < 1e-6
        if step < 0.002:
            assert surface.queries < 60, "far from the solid there are few queries"
