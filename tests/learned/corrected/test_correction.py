import torch

from surfsup.learned.corrected.correction import LARGEST, Correction
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.sph.dfsph import density_slope
from surfsup.sph.kernel_sums import graph
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.state import FRAME_TIME


def test_the_largest_correction_is_five_meters_a_second():
    assert LARGEST * DISPLACEMENT_SCALE / FRAME_TIME == 5.0


def test_smaller_corrections_are_as_they_were():
    small = Correction(torch.tensor([[0.0, 0.0, 0.0], [LARGEST, 0.0, 0.0]]), torch.tensor([[9.0, 0, 0], [7.0, 0, 0]]))
    bounded = small.bounded()
    torch.testing.assert_close(bounded.velocity, small.velocity)
    torch.testing.assert_close(bounded.position, small.position)


def test_a_larger_one_keeps_its_direction_and_its_share_of_displacement():
    large = Correction(torch.tensor([[0.0, 2 * LARGEST, 0.0]]), torch.tensor([[1.0, 2.0, 3.0]])).bounded()
    torch.testing.assert_close(large.velocity, torch.tensor([[0.0, LARGEST, 0.0]]))
    torch.testing.assert_close(large.position, torch.tensor([[0.5, 1.0, 1.5]]))


def test_added_to_what_falls():
    one = Correction(torch.tensor([[1.0, 0.0, 0.0]]), torch.tensor([[0.0, 1.0, 0.0]]))
    positions, velocities = one.added_to(torch.zeros(1, 3), torch.ones(1, 3))
    torch.testing.assert_close(positions, torch.tensor([[0.0, DISPLACEMENT_SCALE, 0.0]]))
    torch.testing.assert_close(velocities, torch.tensor([[1.0 + DISPLACEMENT_SCALE / FRAME_TIME, 1.0, 1.0]]))


def against(rise: list[float], shares: list[float]) -> torch.Tensor:
    """What two particles side by side are made to do, (2, 3)."""
    places, radius = torch.tensor([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]]), 0.06
    seen, scale = graph(places, find_neighbors(places, radius), radius), density_slope(radius)
    slope = scale * torch.stack([kernels[1:] for kernels in seen.kernels])  # each has the other alone
    return Correction.against(torch.tensor(rise), torch.tensor(shares), slope, scale, seen).velocity


def test_pressures_push_both_apart_equally():
    one, other = against([1.0, 0.0], [2.0, 3.0])
    assert one[0] < -0.1
    assert not one[1:].any()
    torch.testing.assert_close(other, -one)
    torch.testing.assert_close(against([2.0, 0.0], [1.0, 3.0])[0], one)  # a share of what rises


def test_nothing_is_done_where_density_does_not_rise_and_nothing_draws_together():
    assert not against([-1.0, 0.0], [2.0, 3.0]).any()
    assert not against([1.0, 1.0], [-2.0, -0.1]).any()
