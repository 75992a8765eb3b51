import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from surfsup.evaluation.compare import Comparison
from surfsup.evaluation.scores import ALL, METRICS, mean_scores, quotient, ratio, ratios, rebound, scores
from surfsup.evaluation.trajectory_statistics import Course


def comparison(frames: int) -> Comparison:
    """Curves that are easy to add up: frame k has Chamfer k, height k + 1 instead of k, energy 2 instead of 4."""
    count = np.arange(frames, dtype=float)
    zero, two = np.zeros(frames), np.full(frames, 2.0)
    density = np.where(count % 10 == 0, 1.5, np.nan)
    own = Course(count + 1, two, zero, zero, zero, zero, density)
    true = Course(count, two + 2, zero, zero, zero, zero, np.where(count % 10 == 0, 1.0, np.nan))
    return Comparison(own, true, count, count**2, 10 * count, 100 * count)


def test_windows_cover_the_fall_the_impact_the_splash_the_rest_and_the_whole():
    found = scores(comparison(800))
    assert list(found) == ["0-100", "100-200", "200-300", "300-end", "first 300", "all"]
    expected = {"0-100": 49.5, "100-200": 149.5, "200-300": 249.5, "300-end": 549.5, "first 300": 149.5, "all": 399.5}
    assert {name: values["chamfer"] for name, values in found.items()} == expected


def test_a_window_that_is_never_reached_is_left_out():
    assert list(scores(comparison(150))) == ["0-100", "100-200", "first 300", "all"]
    assert scores(comparison(150))["first 300"] == scores(comparison(150))["all"]


def test_metrics_worked_by_hand():
    of = comparison(20)
    inside, depth, lost = np.zeros(20), np.zeros(20), np.zeros(20)
    inside[3], depth[3] = 2, -0.03
    inside[4], depth[4] = 1, -0.03
    lost[7] = 5
    found = scores(replace(of, own=replace(of.own, inside=inside, depth=depth, lost=lost)))[ALL]
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


def test_nobody_inside_has_no_mean_depth():
    assert scores(comparison(20))[ALL]["depth"] is None


@pytest.mark.parametrize(
    ("height", "climbs"),
    [
        ([5, 4, 3, 2], 0),  # water that only falls does not rebound
        ([5, 2, 3, 2.5, 1], 1),
        ([5, 1, 1.5, 0.5, 2.5], 2),  # the second rebound is higher, above its own minimum
        ([3], 0),
    ],
)
def test_rebound_is_the_highest_climb_above_the_lowest_before(height, climbs):
    assert rebound(np.array(height, dtype=float)) == climbs


@given(arrays(float, st.integers(1, 30), elements=st.floats(0, 2)))
def test_rebound_equals_its_definition_by_all_pairs(height):
    pairs = [height[late] - height[early] for late in range(len(height)) for early in range(late + 1)]
    assert rebound(height) == pytest.approx(max(pairs))


def test_energies_that_cancel_in_the_ratio_show_in_the_error():
    of = comparison(2)
    own, true = replace(of.own, energy=np.array([1.0, 3.0])), replace(of.true, energy=np.array([3.0, 1.0]))
    found = scores(replace(of, own=own, true=true))[ALL]
    assert (found["energy"], found["energy_error"]) == (1, 1)


def test_water_at_rest_has_no_energy_to_compare():
    assert (ratio(0, 0), ratio(1, 0), ratio(1, 2)) == (1, math.inf, 0.5)


def test_a_rollout_that_blew_up_has_no_scores_and_leaves_no_mean():
    of = comparison(20)
    chamfer, height = of.chamfer.copy(), of.own.height.copy()
    chamfer[9:], height[9:] = np.nan, np.nan
    broken = scores(replace(of, chamfer=chamfer, own=replace(of.own, height=height)))
    assert (broken[ALL]["chamfer"], broken[ALL]["height"], broken[ALL]["rebound"]) == (None, None, None)
    mean = mean_scores([scores(of), broken])
    assert mean[ALL]["chamfer"] is None
    assert mean[ALL]["surface"] == 95
    json.dumps(broken, allow_nan=False)


def test_means_are_over_scenes_and_over_windows_that_all_reach():
    one, other = scores(comparison(150)), scores(comparison(800))
    mean = mean_scores([one, other])
    assert list(mean) == ["0-100", "100-200", "first 300", "all"]
    assert mean[ALL]["chamfer"] == (74.5 + 399.5) / 2
    assert mean_scores([]) == {}


def test_mean_depth_is_over_the_scenes_that_have_one():
    of = comparison(20)
    ones = np.ones(20)
    deep = scores(replace(of, own=replace(of.own, inside=ones, depth=-ones)))
    assert mean_scores([scores(of), deep])[ALL]["depth"] == -1


def test_ratios_to_the_floor():
    one = scores(comparison(120))
    assert all(value in (1, None) for value in ratios(one, one)[ALL].values())
    assert ratios(one, one)[ALL]["penetration"] == 1  # both none: as good as the floor
    assert ratios(one, {}) == {}
    assert (quotient(3, 2), quotient(1, 0), quotient(0, 0), quotient(None, 1), quotient(1, None)) == (
        1.5,
        None,
        1,
        None,
        None,
    )
