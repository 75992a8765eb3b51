import pytest
import torch

from surfsup.design.ascent import LONGEST, Ascent
from surfsup.design.parameter import Parameter


def ascent(start=0.5, iterations=50, **more) -> Ascent:
    parameter = Parameter(start, **{"lower": 0.0, "upper": 1.0, "step": 0.05, **more})
    return Ascent({"x": parameter}, {"x": torch.tensor(start)}, iterations)


def x_of(one: Ascent) -> float:
    return float(one.values["x"].detach())


def slope(*values: float) -> torch.Tensor:
    """In reward a step."""
    return torch.tensor(values)


class TestTheAscent:
    def test_finds_the_top_of_a_hill_of_any_height(self):
        for height in (1e-6, 1.0, 1e6):
            one = ascent()
            for _ in range(50):
                one.take(slope(-2 * height * (x_of(one) - 0.3)))
            assert x_of(one) == pytest.approx(0.3, abs=0.01)

    def test_lands_on_a_top_where_slopes_are_reliable(self):
        for reliable, off in ((True, 1e-3), (False, 0.02)):
            one = ascent(start=0.08)
            ways = []
            for _ in range(9):
                one.take(slope(0.3 - x_of(one)), reliable)
                ways.append(abs(x_of(one) - 0.3))
            assert (min(ways[-3:]) < off) == reliable

    def test_goes_where_it_is_told(self):
        one = ascent()
        one.take(slope(1.0), leap=slope(-2.0))
        assert x_of(one) == pytest.approx(0.5 - 2 * 0.05)

    def test_stays_in_the_range(self):
        one = ascent()
        for _ in range(50):
            one.take(slope(1.0))
            assert 0 <= x_of(one) <= 1

    def test_a_value_to_keep_is_kept(self):
        one = ascent(start=0.02, keeps=0.0)
        one.take(slope(-1.0))
        assert x_of(one) == 0 and not one.free.any()
        for _ in range(9):
            one.take(slope(1.0))
        assert x_of(one) == 0

    def test_near_to_it_counts_as_reached(self):
        one = ascent(start=0.06, keeps=0.0, reach=0.015)
        one.take(slope(-1.0))
        assert x_of(one) == 0

    def test_a_long_gradient_is_cut_and_counted(self):
        one = ascent()
        for _ in range(10):
            one.take(slope(1.0))
        assert one.cut == 0
        one.take(slope(1e9))
        assert one.cut == 1
        assert float(one.memory["slope"]) <= LONGEST

    @pytest.mark.parametrize("value", [float("nan"), float("inf")])
    def test_one_that_is_not_finite_is_left_out_and_counted(self, value):
        one = ascent()
        one.take(slope(value))
        assert one.cut == 1 and x_of(one) == 0.5
