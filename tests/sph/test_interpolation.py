import numpy as np
import pytest
import torch

from surfsup.scene import FRAME_TIME
from surfsup.sph.interpolation import frames_needed, hermite, resample


def test_hermite_splines_pass_through_both_frames_with_their_velocities():
    random = torch.Generator().manual_seed(0)
    old, new = (tuple(torch.randn(2, 4, 3, generator=random, dtype=torch.float64)) for _ in range(2))
    for part, frame in ((0.0, old), (1.0, new)):
        positions, velocities = hermite(old, new, part)
        torch.testing.assert_close(positions, frame[0])
        torch.testing.assert_close(velocities, frame[1])
    step = 1e-6
    (ahead, _), (behind, _), (_, velocity) = (hermite(old, new, 0.3 + move) for move in (step, -step, 0.0))
    torch.testing.assert_close((ahead - behind) / (2 * step * FRAME_TIME), velocity, rtol=1e-5, atol=1e-5)


def cubic(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A motion of third order, which the splines have exactly: positions and velocities (1, 3)."""
    return np.array([[time, time**2, 1 - 50 * time**3]]), np.array([[1.0, 2 * time, -150 * time**2]])


@pytest.mark.parametrize("interval", [0.5, 1.0, 1.7, 3.0, 10 / 3])
def test_a_cubic_motion_is_exact_at_any_rate(interval):
    count = frames_needed(7, interval)
    result = list(resample((cubic(number * FRAME_TIME) for number in range(count)), interval))
    assert len(result) >= 7
    for number, (positions, velocities) in enumerate(result):
        expected = cubic(number * interval * FRAME_TIME)
        np.testing.assert_allclose(positions, expected[0], atol=1e-12)
        np.testing.assert_allclose(velocities, expected[1], atol=1e-10)


def test_the_rate_of_the_simulator_leaves_its_frames_as_they_are():
    frames = [cubic(number * FRAME_TIME) for number in range(5)]
    assert [id(one) for one, _ in resample(frames, 1.0)] == [id(one) for one, _ in frames]
