import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surfsup.evaluation.metrics import (
    center_height,
    chamfer,
    chamfer_surface,
    inside_container,
    kd_tree,
    kinetic_energy,
    max_density,
    nearest_distances,
)
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline

SEEDS = st.integers(0, 2**32 - 1)
COUNTS = st.integers(1, 60)


def brute_force(prediction: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances both ways by all pairs in double precision."""
    distances = np.linalg.norm(prediction[:, None].astype(np.float64) - reference[None], axis=-1)
    return distances.min(axis=1), distances.min(axis=0)


@given(COUNTS, COUNTS, SEEDS)
def test_chamfer_equals_all_pairs_by_brute_force(count, other, seed):
    random = np.random.default_rng(seed)
    prediction, reference = np.float32(random.normal(size=(count, 3))), np.float32(random.normal(size=(other, 3)))
    there, back = brute_force(prediction, reference)
    found = chamfer(prediction, reference)
    expected = there.mean() + back.mean(), (there**2).mean() + (back**2).mean()
    assert (found.plain, found.squared) == pytest.approx(expected, rel=1e-12)


@given(COUNTS, COUNTS, SEEDS)
def test_chamfer_surface_equals_its_formula_by_brute_force(count, other, seed):
    random = np.random.default_rng(seed)
    prediction, reference = random.normal(size=(count, 3)), random.normal(size=(other, 3))
    prediction_near, reference_near = random.random(count) < 0.5, random.random(other) < 0.5
    there, back = brute_force(prediction, reference)
    found = chamfer_surface(nearest_distances(kd_tree(prediction), kd_tree(reference)), prediction_near, reference_near)
    plain = there[prediction_near].sum() + back[reference_near].sum()
    squared = (there[prediction_near] ** 2).sum() + (back[reference_near] ** 2).sum()
    assert (found.plain, found.squared) == pytest.approx((plain, squared), rel=1e-12)


@pytest.mark.parametrize(
    ("prediction", "reference", "plain", "squared"),
    [
        ([[0, 0, 0]], [[3, 4, 0]], 10, 50),
        # Both predictions are nearest to the first; the second reference particle is 2 from the nearest prediction.
        ([[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [3, 0, 0]], 0.5 + 1, 0.5 + 2),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 0, 0]], 2 / 3, 2 / 3),
        ([[1, 2, 3], [4, 5, 6]], [[4, 5, 6], [1, 2, 3]], 0, 0),
    ],
)
def test_chamfer_worked_by_hand(prediction, reference, plain, squared):
    found = chamfer(np.float32(prediction), np.float32(reference))
    assert (found.plain, found.squared) == pytest.approx((plain, squared))


def test_chamfer_surface_worked_by_hand():
    """Each near particle is compared with ALL particles of the other set, near the surface or not."""
    prediction, reference = np.float32([[0, 0, 0], [5, 0, 0]]), np.float32([[0, 0, 2], [5, 0, 3], [9, 0, 0]])
    distances = nearest_distances(kd_tree(prediction), kd_tree(reference))
    first = chamfer_surface(distances, np.array([True, False]), np.array([False, True, False]))
    assert (first.plain, first.squared) == pytest.approx((2 + 3, 4 + 9))
    none = chamfer_surface(distances, np.zeros(2, dtype=bool), np.zeros(3, dtype=bool))
    assert (none.plain, none.squared) == (0, 0)


@given(COUNTS, COUNTS, SEEDS)
def test_chamfer_is_symmetric_and_invariant_to_order_and_translation_and_scales(count, other, seed):
    random = np.random.default_rng(seed)
    one, two = random.normal(size=(count, 3)), random.normal(size=(other, 3))
    found = chamfer(one, two)
    assert chamfer(two, one).plain == pytest.approx(found.plain)
    assert chamfer(two, one).squared == pytest.approx(found.squared)
    assert chamfer(random.permutation(one), two).squared == pytest.approx(found.squared)
    assert chamfer(one + 7, two + 7).plain == pytest.approx(found.plain)
    assert chamfer(3 * one, 3 * two).plain == pytest.approx(3 * found.plain)
    assert chamfer(3 * one, 3 * two).squared == pytest.approx(9 * found.squared)
    assert chamfer(one, one).plain == 0


def test_height_and_energy_worked_by_hand():
    assert center_height(np.float32([[0, 0, 1], [9, 9, 2]])) == 1.5
    assert kinetic_energy(np.float32([[3, 0, 4], [0, 0, 0]])) == 0.5 * 25 / 2


def test_the_height_of_many_particles_is_accurate_in_spite_of_float32():
    heights = np.full((1_000_000, 3), 0.1, dtype=np.float32)
    assert center_height(heights) == pytest.approx(float(np.float32(0.1)), rel=1e-12)


def lattice(side: int, spacing: float) -> np.ndarray:
    axis = spacing * np.arange(side)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def test_density_is_one_on_the_lattice_and_grows_under_compression():
    assert max_density(kd_tree(lattice(7, 0.03))) == pytest.approx(1, abs=0.01)
    assert max_density(kd_tree(lattice(7, 0.03 * 0.9))) == pytest.approx(1 / 0.9**3, rel=0.05)


def test_density_equals_the_sum_over_all_pairs():
    points = np.random.default_rng(0).uniform(0, 0.1, (40, 3))  # fewer than MAX_NEIGHBORS
    q = np.linalg.norm(points[:, None] - points[None], axis=-1) / KERNEL_SUPPORT
    assert max_density(kd_tree(points)) == pytest.approx(0.03**3 * KERNEL_PEAK * cubic_spline(q).sum(axis=1).max())


def test_a_lone_particle_has_its_self_density_and_a_collapsed_fluid_is_very_dense():
    alone = max_density(kd_tree(np.zeros((1, 3))))
    assert alone == pytest.approx(0.03**3 * 8 / (np.pi * 0.06**3))
    assert max_density(kd_tree(np.zeros((5000, 3)))) == pytest.approx(64 * alone)


def test_positions_outside_or_not_finite_are_not_inside_the_container():
    positions = np.float32([[0, 0, 1], [0.5, 0, 0], [0.51, 0, 1], [0, 0, -0.01], [np.nan, 0, 1], [np.inf, 0, 1]])
    found = inside_container(positions, np.float32([-0.5, -0.5, 0]), np.float32([0.5, 0.5, 2]))
    assert found.tolist() == [True, True, False, False, False, False]
