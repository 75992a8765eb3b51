from itertools import pairwise

import pytest

from surfsup.optim.schedule import learning_rate
from tests.optim.conftest import config

RATES = {"steps": 1000, "warm_up": 100, "learning_rate": 2e-3, "final_learning_rate": 2e-5}


@pytest.mark.parametrize(("schedule", "middle"), [("cosine", (2e-3 + 2e-5) / 2), ("exponential", 2e-4)])
def test_the_learning_rate_rises_linearly_and_decays_to_its_final_value(schedule, middle):
    options = config(schedule=schedule, **RATES)
    rates = [learning_rate(options, step) for step in range(1000)]
    assert rates[0] == pytest.approx(2e-5)
    assert rates[99] == rates[100] == pytest.approx(2e-3)
    assert rates[550] == pytest.approx(middle)
    assert all(a < b for a, b in pairwise(rates[:100]))
    assert all(a > b for a, b in pairwise(rates[100:]))
    assert rates[-1] == pytest.approx(2e-5, rel=0.01)
    assert learning_rate(options, 1000) == pytest.approx(2e-5)


def test_the_inverse_square_root_does_not_depend_on_the_number_of_steps():
    rates = [
        [learning_rate(config(schedule="inverse-sqrt", **{**RATES, "steps": steps}), step) for step in range(1000)]
        for steps in (200, 1000)
    ]
    assert rates[0] == rates[1]
    assert rates[0][0] == pytest.approx(2e-5)
    assert max(rates[0]) == rates[0][99] == pytest.approx(2e-3)
    assert rates[0][399] == pytest.approx(1e-3)
    assert all(a > b for a, b in pairwise(rates[0][99:]))


def test_the_inverse_square_root_ends_at_the_final_rate():
    assert learning_rate(config(schedule="inverse-sqrt", **RATES), 10_000_000) == 2e-5
    assert learning_rate(config(schedule="inverse-sqrt", **{**RATES, "warm_up": 0}), 0) == 2e-3


def test_without_warm_up_the_first_step_has_the_full_rate():
    assert learning_rate(config(**{**RATES, "warm_up": 0}), 0) == 2e-3
