import numpy as np
import pytest

from surfsup.datasets.generation.statistics import Sums, Tally, normalization

GRAVITY = (1.0, 0.0, -10.0)


def frames(seed: int, count: int = 7, particles: int = 5) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.normal(size=(count, 3, particles)), random.normal(2, 3, size=(count, 3, particles))


def sums_of(positions: np.ndarray, velocities: np.ndarray) -> Sums:
    tally = Tally(GRAVITY)
    for first in range(0, len(positions), 3):
        tally.look_at(positions[first : first + 3], velocities[first : first + 3])
    return tally.sums


def test_they_are_the_means_and_deviations_of_all_frames_of_all_scenes_together():
    scenes = [frames(seed) for seed in range(3)]
    said = normalization(sums_of(*scene) for scene in scenes)
    positions, velocities = (np.concatenate(values, axis=2) for values in zip(*scenes, strict=True))
    # The free fall of one frame from velocity v: five steps of 1 ms, each gaining speed before it moves.
    fall = 0.005 * velocities[:-1] + 15e-6 * np.array(GRAVITY)[:, None]
    expected = {
        "velocity": velocities[1:],
        "velocity_change": np.diff(velocities, axis=0),
        "beyond_ballistic": np.diff(positions, axis=0) - fall,
    }
    assert said["samples"] == 6 * 15
    for name, values in expected.items():
        assert said[name]["mean"] == pytest.approx(values.mean(axis=(0, 2)).tolist(), rel=1e-5)
        assert said[name]["standard_deviation"] == pytest.approx(values.std(axis=(0, 2)).tolist(), rel=1e-5)


def test_notes_give_back_the_same_sums():
    sums = sums_of(*frames(4))
    back = Sums.from_notes(sums.to_notes())
    assert back.samples == sums.samples
    assert normalization([back]) == normalization([sums])


def test_one_frame_alone_says_nothing():
    assert normalization([sums_of(*frames(0, count=1))])["samples"] == 0
