import numpy as np
import pytest

from surfsup.datasets.generation.statistics import MomentAccumulator, Moments, normalization_statistics

GRAVITY = (1.0, 0.0, -10.0)


def frames(seed: int, count: int = 7, particles: int = 5) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.normal(size=(count, 3, particles)), random.normal(2, 3, size=(count, 3, particles))


def moments_of(positions: np.ndarray, velocities: np.ndarray) -> Moments:
    accumulator = MomentAccumulator(GRAVITY)
    for first in range(0, len(positions), 3):
        accumulator.update(positions[first : first + 3], velocities[first : first + 3])
    return accumulator.moments


def test_statistics_are_the_means_and_deviations_over_all_frames_of_all_scenes():
    scenes = [frames(seed) for seed in range(3)]
    statistics = normalization_statistics(moments_of(*scene) for scene in scenes)
    positions, velocities = (np.concatenate(values, axis=2) for values in zip(*scenes, strict=True))
    # One frame of free fall: five substeps of 1 ms, each of which updates the velocity before the position.
    fall = 0.005 * velocities[:-1] + 15e-6 * np.array(GRAVITY)[:, None]
    expected = {
        "velocity": velocities[1:],
        "velocity_change": np.diff(velocities, axis=0),
        "beyond_ballistic": np.diff(positions, axis=0) - fall,
    }
    assert statistics["samples"] == 6 * 15
    for name, values in expected.items():
        assert statistics[name]["mean"] == pytest.approx(values.mean(axis=(0, 2)).tolist(), rel=1e-5)
        assert statistics[name]["standard_deviation"] == pytest.approx(values.std(axis=(0, 2)).tolist(), rel=1e-5)


def test_attributes_restore_the_moments():
    moments = moments_of(*frames(4))
    restored = Moments.from_attributes(moments.to_attributes())
    assert restored.samples == moments.samples
    assert normalization_statistics([restored]) == normalization_statistics([moments])


def test_the_attributes_have_the_names_of_version_0_1():
    quantities = ("velocity", "velocity_change", "beyond_ballistic")
    names = {f"{quantity}_{moment}" for quantity in quantities for moment in ("sum", "squares")}
    assert moments_of(*frames(4)).to_attributes().keys() == {"samples", *names}


def test_a_single_frame_has_no_samples():
    assert normalization_statistics([moments_of(*frames(0, count=1))])["samples"] == 0
