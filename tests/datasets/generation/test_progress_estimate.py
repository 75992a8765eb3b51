import pytest

from surfsup.datasets.generation.progress_estimate import ProgressEstimate


def test_the_estimate_uses_the_duration_of_one_simulation_not_the_number_that_ended():
    reports = []
    estimate = ProgressEstimate(0, 8, lambda *report: reports.append(report))
    estimate.step(10.0, slots=4)
    # Seven are left, of which three run and are half done: 5.5 simulations of 10 s, four at a time.
    assert reports == [(0, 8, None), (1, 8, pytest.approx(13.75))]


def test_simulations_that_were_there_before_do_not_change_the_estimate():
    reports = []
    estimate = ProgressEstimate(90, 100, lambda *report: reports.append(report))
    estimate.step(20.0, slots=1)
    assert reports[-1] == (91, 100, pytest.approx(180))


def test_the_estimate_is_zero_at_the_end_and_none_without_workers():
    reports = []
    estimate = ProgressEstimate(0, 2, lambda *report: reports.append(report))
    estimate.step(5.0, slots=0)
    estimate.step(5.0, slots=2)
    assert [left for *_, left in reports] == [None, None, 0.0]


def test_a_simulation_without_a_duration_counts_but_does_not_change_the_estimate():
    reports = []
    estimate = ProgressEstimate(0, 3, lambda *report: reports.append(report))
    estimate.step(None, slots=1)
    estimate.step(10.0, slots=1)
    assert reports == [(0, 3, None), (1, 3, None), (2, 3, pytest.approx(10))]
