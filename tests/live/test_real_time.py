import pytest

from surfsup.live.real_time import LAG, Rates, RealTime


def test_a_fast_simulation_is_in_real_time():
    timing, steps = RealTime(0.005, 10.0), 0
    for millisecond in range(1000):
        while timing.due(10.0 + millisecond / 1000):
            steps += 1
    assert steps == 200


def test_a_slow_simulation_gives_up_time_instead_of_running_after_it():
    timing, now = RealTime(0.005, 0.0), 0.0
    for _ in range(100):
        assert timing.due(now)
        now += 0.050  # a step takes ten times as long as it simulates
    late = sum(timing.due(now) for _ in range(1000))
    assert late * 0.005 <= LAG + 0.050


def test_a_pause_is_not_made_up_for():
    timing = RealTime(0.005, 0.0)
    assert timing.due(0.0) and not timing.due(0.001)
    timing.restart(60.0)
    assert timing.due(60.0) and not timing.due(60.001)


def test_rates_are_those_of_the_last_second():
    rates = Rates()
    assert (rates.pictures, rates.speed) == (0, 0)
    for number in range(200):
        rates.count(number / 40, 0.0125)
    assert rates.pictures == pytest.approx(40) and rates.speed == pytest.approx(0.5)
    rates.count(100.0, 1.0)
    assert rates.pictures == 0
