import pytest

from surfsup.evaluation.scores import METRICS
from surfsup.evaluation.table import rows

ENERGY = next(metric for metric in METRICS if metric.key == "energy")


@pytest.mark.parametrize(
    ("value", "ratio", "shown"),
    [(0.992, 0.99, ["0.992", "0.99"]), (12.5, 99.994, ["12.500", "99.99"]), (-0.5, 378.0, ["-0.500", "378"])],
)
def test_values_have_the_metric_s_decimals(value, ratio, shown):
    (line,) = rows([("all", {"energy": value}, {"energy": 1.0}, {"energy": ratio})], [ENERGY], with_floor=True)
    assert line.split() == ["all", shown[0], "1.000", shown[1]]


@pytest.mark.parametrize("value", [1.2e5, 1.2e8, 1.2e38])
def test_values_of_a_diverged_rollout_fit_into_their_column(value):
    ordinary = {"energy": 1.0}
    diverged = {"energy": value}
    lines = rows([("a", ordinary, ordinary, ordinary), ("b", diverged, ordinary, diverged)], [ENERGY], with_floor=True)
    assert len(lines[0]) == len(lines[1]) == len(lines[0].rstrip())
    assert float(lines[1].split()[-1]) == pytest.approx(value, rel=0.5)
