"""Water that flows as textbooks say: levels of two vessels, the parabola in a bucket that spins."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")


def test_communicating_vessels_have_one_level():
    simulation = sf.Simulation(
        Scene.from_yaml(
            "container: {size: [0.56, 0.2, 0.8]}\n"
            "surface: {box: {size: [0.06, 0.4, 0.8]}, at: [0.05, 0, 0.56]}\n"
            "fluid: [{block: {min: [-0.27, -0.09, 0.02], max: [0.01, 0.09, 0.45]}}]",
            "test",
        )
    )
    for _ in range(500):
        simulation.step()
    levels = [[], []]
    for _ in range(10):
        for _ in range(5):
            positions = simulation.step().positions
        for side, heights in zip((-1, 1), levels, strict=True):
            heights.append(np.quantile(positions[side * (positions[:, 0] - 0.05) > 0.03, 2], 0.97))
    left, right = np.mean(levels, axis=1)
    assert 0.15 < left < 0.35
    assert left == pytest.approx(right, abs=0.015)


def test_water_in_a_square_bucket_that_spins_turns_with_it_and_rises_to_a_parabola():
    rate = 5.0
    simulation = sf.Simulation(
        Scene.from_yaml(
            f"container: {{size: [0.5, 0.5, 0.8], motion: {{spin: {{rate: {rate}}}}}}}\n"
            "fluid: [{block: {min: [-0.23, -0.23, 0.02], max: [0.23, 0.23, 0.22]}}]",
            "test",
        )
    )
    for _ in range(500):
        simulation.step()
    frames = [simulation.step() for _ in range(100)][::10]
    place, velocity = (np.concatenate([getattr(f, name) for f in frames]) for name in ("positions", "velocities"))
    radial = np.hypot(place[:, 0], place[:, 1])
    turn = (place[:, 0] * velocity[:, 1] - place[:, 1] * velocity[:, 0]).sum() / (radial**2).sum()
    assert turn == pytest.approx(rate, rel=0.02)
    inner, outer = (np.quantile(place[(radial >= low) & (radial < low + 0.06), 2], 0.97) for low in (0, 0.18))
    expected = rate**2 / (2 * 9.81) * (0.21**2 - 0.04**2)
    assert outer - inner == pytest.approx(expected, abs=0.015)
