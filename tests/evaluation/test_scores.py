import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from surfsup.evaluation.compare import Comparison
from surfsup.evaluation.scores import (
    ALL,
    METRICS,
    compute_scores,
    energy_ratio,
    floor_ratio,
    floor_ratios,
    mean_scores,
    rebound,
)
from surfsup.evaluation.trajectory_statistics import TrajectoryStatistics


def comparison(frames: int) -> Comparison:
    """Curves with simple means: frame k has Chamfer k, height k + 1 instead of k and energy 2 instead of 4."""
    count = np.arange(frames, dtype=float)
    zero, two = np.zeros(frames), np.full(frames, 2.0)
    density = np.where(count % 10 == 0, 1.5, np.nan)
    prediction = TrajectoryStatistics(count + 1, two, zero, zero, zero, zero, density)
    reference = TrajectoryStatistics(count, two + 2, zero, zero, zero, zero, np.where(count % 10 == 0, 1.0, np.nan))
    return Comparison(prediction, reference, count, count**2, 10 * count, 100 * count)


def test_windows_are_fall_impact_splash_rest_and_combinations():
    found = compute_scores(comparison(800))
    assert list(found) == ["0-100", "100-200", "200-300", "300-end", "first 300", "all"]
    expected = {"0-100": 49.5, "100-200": 149.5, "200-300": 249.5, "300-end": 549.5, "first 300": 149.5, "all": 399.5}
    assert {name: values["chamfer"] for name, values in found.items()} == expected


@pytest.mark.parametrize(
    ("frames", "windows"),
    [(20, ["all"]), (150, ["0-100", "100-200", "all"]), (300, ["0-100", "100-200", "200-300", "first 300", "all"])],
)
def test_a_window_that_ends_beyond_the_last_frame_is_left_out_unless_it_is_a_part(frames, windows):
    assert list(compute_scores(comparison(frames))) == windows


def test_metrics_worked_by_hand():
    curves = comparison(20)
    inside, depth, lost = np.zeros(20), np.zeros(20), np.zeros(20)
    inside[3], depth[3] = 2, -0.03
    inside[4], depth[4] = 1, -0.03
    lost[7] = 5
    found = compute_scores(
        replace(curves, prediction=replace(curves.prediction, inside=inside, depth=depth, lost=lost))
    )[ALL]
    assert found == pytest.approx(
        {
            "chamfer": 9.5,
            "chamfer_squared": 123.5,
            "surface": 95,
            "surface_squared": 950,
            "penetration": 3,
            "depth": -0.02,
            "height": 1,
            "energy": 0.5,
            "energy_error": 0.5,
            "rebound": 0,
            "density": 1.5,
            "lost": 5,
        }
    )
    assert list(found) == [metric.key for metric in METRICS]


def test_without_particles_inside_there_is_no_mean_depth():
    assert compute_scores(comparison(20))[ALL]["depth"] is None


@pytest.mark.parametrize(
    ("height", "rise"),
    [
        ([5, 4, 3, 2], 0),  # falling water does not rebound
        ([5, 2, 3, 2.5, 1], 1),
        ([5, 1, 1.5, 0.5, 2.5], 2),  # the second rebound is the larger one
        ([3], 0),
    ],
)
def test_rebound_is_the_largest_rise_above_the_earlier_minimum(height, rise):
    assert rebound(np.array(height, dtype=float)) == rise


@given(arrays(float, st.integers(1, 30), elements=st.floats(0, 2)))
def test_rebound_equals_its_definition_by_all_pairs(height):
    rises = [height[late] - height[early] for late in range(len(height)) for early in range(late + 1)]
    assert rebound(height) == pytest.approx(max(rises))


def test_errors_that_cancel_in_the_energy_ratio_remain_in_the_energy_error():
    curves = comparison(2)
    prediction = replace(curves.prediction, energy=np.array([1.0, 3.0]))
    reference = replace(curves.reference, energy=np.array([3.0, 1.0]))
    found = compute_scores(replace(curves, prediction=prediction, reference=reference))[ALL]
    assert (found["energy"], found["energy_error"]) == (1, 1)


def test_the_energy_ratio_of_water_at_rest_is_one():
    assert (energy_ratio(0, 0), energy_ratio(1, 0), energy_ratio(1, 2)) == (1, math.inf, 0.5)


def test_a_diverged_rollout_has_no_scores_and_leaves_no_mean():
    curves = comparison(20)
    chamfer, height = curves.chamfer.copy(), curves.prediction.height.copy()
    chamfer[9:], height[9:] = np.nan, np.nan
    broken = compute_scores(replace(curves, chamfer=chamfer, prediction=replace(curves.prediction, height=height)))
    assert (broken[ALL]["chamfer"], broken[ALL]["height"], broken[ALL]["rebound"]) == (None, None, None)
    mean = mean_scores([compute_scores(curves), broken])
    assert mean[ALL]["chamfer"] is None
    assert mean[ALL]["surface"] == 95
    json.dumps(broken, allow_nan=False)


def test_means_are_over_the_windows_that_all_scenes_reach():
    one, other = compute_scores(comparison(150)), compute_scores(comparison(800))
    mean = mean_scores([one, other])
    assert list(mean) == ["0-100", "100-200", "all"]
    assert mean[ALL]["chamfer"] == (74.5 + 399.5) / 2
    assert mean_scores([]) == {}


def test_mean_depth_skips_scenes_without_one():
    curves = comparison(20)
    ones = np.ones(20)
    deep = compute_scores(replace(curves, prediction=replace(curves.prediction, inside=ones, depth=-ones)))
    assert mean_scores([compute_scores(curves), deep])[ALL]["depth"] == -1


def test_ratios_to_the_floor():
    one = compute_scores(comparison(120))
    assert all(value in (1, None) for value in floor_ratios(one, one)[ALL].values())
    assert floor_ratios(one, one)[ALL]["penetration"] == 1  # both 0
    assert floor_ratios(one, {}) == {}
    assert (floor_ratio(3, 2), floor_ratio(1, 0), floor_ratio(0, 0), floor_ratio(None, 1), floor_ratio(1, None)) == (
        1.5,
        None,
        1,
        None,
        None,
    )
