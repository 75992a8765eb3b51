import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.datasets.generation.physical_check import DENSITY_EVERY, Check, SolidWatch, UnphysicalError
from surfsup.scene import FRAME_TIME, Scene
from surfsup.sdf import Sphere, Surface

SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\n"
    "fluid: [{block: {min: [-0.1, -0.1, 1.0], max: [0.1, 0.1, 1.2]}}]",
    "test",
)
FRAMES = 2 * DENSITY_EVERY


def fall() -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (frames, 3, N) of a block in free fall, which ends above the ball."""
    start = SCENE.initial_particles(None).positions.T.astype(float)
    times = FRAME_TIME * np.arange(FRAMES)[:, None, None]
    gravity = np.array(SCENE.gravity)[:, None]
    velocities = np.broadcast_to(times * gravity, (FRAMES, *start.shape))
    return start + 0.5 * times**2 * gravity, velocities.copy()


def complaint(positions: np.ndarray, velocities: np.ndarray) -> str | None:
    """What is found, which must not depend on how many frames are looked at together."""
    found = set()
    for together in (1, 7, FRAMES):
        check = Check(SCENE, SCENE.build_surface())
        try:
            for first in range(0, FRAMES, together):
                check.look_at(positions[first : first + together], velocities[first : first + together])
        except UnphysicalError as error:
            found.add(str(error))
        else:
            found.add(None)
    (said,) = found
    return said


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ((0.0, 0.0, 1.0), None),
        ((np.nan, 0.0, 1.0), "a position or velocity is not finite"),
        ((0.6, 0.0, 1.0), "a particle left the container"),
        ((0.0, 0.0, -0.01), "a particle left the container"),
        ((0.0, 0.0, 2.01), "a particle left the container"),
        ((0.0, 0.0, 0.59), "a particle was 0.01 m inside the solid"),
    ],
)
def test_one_particle_where_it_cannot_be_is_found(place, said):
    positions, velocities = fall()
    positions[30, :, 5] = place
    assert complaint(positions, velocities) == said


def test_a_velocity_that_is_not_finite_is_found():
    positions, velocities = fall()
    velocities[30, 1, 2] = np.inf
    assert complaint(positions, velocities) == "a position or velocity is not finite"


@pytest.mark.parametrize(("speed", "said"), [(20.0, None), (31.0, "a particle flew at 31 m/s")])
def test_a_particle_may_fly_its_diameter_in_a_step_of_the_solver(speed, said):
    """The others lose the energy that it takes."""
    positions, velocities = fall()
    velocities[45:] = 0
    velocities[45:, 0, 0] = speed
    found = complaint(positions, velocities)
    assert found is None if said is None else found.startswith(said)


def test_water_that_gains_energy_is_found_and_one_that_loses_it_may():
    positions, velocities = fall()
    slower = velocities.copy()
    slower[30:] *= 0.9
    assert complaint(positions, slower) is None
    velocities[30:, 0] += 0.4
    assert complaint(positions, velocities) == "the fluid gained 0.08 J/kg, where it can only lose: it burst"


@pytest.mark.parametrize(("shrunk", "said"), [(0.99, None), (0.97, "the fluid was 1.1 times as dense as at rest")])
def test_water_that_was_pressed_together_is_found(shrunk, said):
    """A length of 0.97 is a density of 1.096 inside."""
    positions, velocities = fall()
    middle = positions.mean(axis=2, keepdims=True)
    positions[DENSITY_EVERY] = (middle + shrunk * (positions - middle))[DENSITY_EVERY]
    found = complaint(positions, velocities)
    assert found is None if said is None else found.startswith(said)


class Counted(Surface):
    """A ball that counts how often it is asked."""

    def __init__(self) -> None:
        super().__init__()
        self.ball, self.asked = Sphere(0.2), 0

    def distance(self, points: torch.Tensor) -> torch.Tensor:
        self.asked += len(points)
        return self.ball.distance(points)

    def bounds(self) -> torch.Tensor:
        return self.ball.bounds()


@given(seed=st.integers(0, 10_000), step=st.floats(0.001, 0.2), together=st.integers(1, 9))
def test_no_particle_gets_inside_unseen_however_it_wanders(seed, step, together):
    random = np.random.default_rng(seed)
    steps = random.normal(scale=step, size=(60, 3, 4))
    positions = np.array([0.5, 0.3, 0.2])[:, None] + steps.cumsum(axis=0)
    depth = 0.2 - np.linalg.norm(positions, axis=1).min()
    surface = Counted()
    watch = SolidWatch(surface)
    try:
        for first in range(0, 60, together):
            watch.look_at(positions[first : first + together])
    except UnphysicalError:
        assert depth > -1e-6
    else:
        assert depth < 1e-6
        if step < 0.002:
            assert surface.asked < 60, "far from the solid few distances are measured"
