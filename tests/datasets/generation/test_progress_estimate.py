import pytest

from surfsup.datasets.generation.progress_estimate import Pace


def test_what_is_left_follows_from_the_time_of_one_simulation_not_from_how_many_ended():
    told = []
    pace = Pace(0, 8, lambda *now: told.append(now))
    pace.step(10.0, slots=4)
    # Seven are left; three of them run and are half done: 5.5 simulations of 10 s, four at a time.
    assert told == [(0, 8, None), (1, 8, pytest.approx(13.75))]


def test_those_that_were_there_before_say_nothing_of_the_speed():
    told = []
    pace = Pace(90, 100, lambda *now: told.append(now))
    pace.step(20.0, slots=1)
    assert told[-1] == (91, 100, pytest.approx(180))


def test_at_the_end_nothing_is_left_and_without_workers_nobody_knows():
    told = []
    pace = Pace(0, 2, lambda *now: told.append(now))
    pace.step(5.0, slots=0)
    pace.step(5.0, slots=2)
    assert [left for *_, left in told] == [None, None, 0.0]


def test_what_nobody_timed_counts_but_says_nothing_of_the_speed():
    told = []
    pace = Pace(0, 3, lambda *now: told.append(now))
    pace.step(None, slots=1)
    pace.step(10.0, slots=1)
    assert told == [(0, 3, None), (1, 3, None), (2, 3, pytest.approx(10))]
