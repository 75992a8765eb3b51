import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surfsup.evaluation.metrics import centre_height, chamfer, kinetic_energy


def brute_force(predicted: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    apart = np.linalg.norm(predicted[:, None].astype(np.float64) - truth[None], axis=-1)
    there, back = apart.min(axis=1), apart.min(axis=0)
    return there.mean() + back.mean(), (there**2).mean() + (back**2).mean()


@given(st.integers(1, 60), st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_chamfer_equals_all_pairs_by_brute_force(count, other, seed):
    random = np.random.default_rng(seed)
    predicted, truth = random.normal(size=(count, 3)), random.normal(size=(other, 3))
    found = chamfer(predicted, truth)
    assert (found.plain, found.squared) == pytest.approx(brute_force(predicted, truth), rel=1e-12)


@pytest.mark.parametrize(
    ("predicted", "truth", "plain", "squared"),
    [
        ([[0, 0, 0]], [[3, 4, 0]], 10, 50),
        # Both predictions are next to the first; the second of the truth is 2 from the nearer one.
        ([[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [3, 0, 0]], 0.5 + 1, 0.5 + 2),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 0, 0]], 2 / 3, 2 / 3),
        ([[1, 2, 3], [4, 5, 6]], [[4, 5, 6], [1, 2, 3]], 0, 0),
    ],
)
def test_chamfer_worked_by_hand(predicted, truth, plain, squared):
    found = chamfer(np.float32(predicted), np.float32(truth))
    assert (found.plain, found.squared) == pytest.approx((plain, squared))


def test_chamfer_is_symmetric_in_what_it_compares():
    random = np.random.default_rng(0)
    one, other = random.normal(size=(40, 3)), random.normal(size=(30, 3))
    assert chamfer(one, other).plain == pytest.approx(chamfer(other, one).plain)
    assert chamfer(one, other).squared == pytest.approx(chamfer(other, one).squared)


def test_height_and_energy_worked_by_hand():
    assert centre_height(np.float32([[0, 0, 1], [9, 9, 2]])) == 1.5
    assert kinetic_energy(np.float32([[3, 0, 4], [0, 0, 0]])) == 0.5 * 25 / 2


def test_height_of_many_particles_is_not_lost_to_float32():
    heights = np.full((1_000_000, 3), 0.1, dtype=np.float32)
    assert centre_height(heights) == pytest.approx(float(np.float32(0.1)), rel=1e-12)
