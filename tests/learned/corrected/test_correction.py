from types import SimpleNamespace

import torch

from surfsup.learned.corrected.correction import MAX_CORRECTION, Correction
from surfsup.learned.corrected.features import DENSITY_SCALE, DISPLACEMENT_SCALE
from surfsup.scene import FRAME_TIME
from surfsup.sph.dfsph import GRADIENT_SCALE
from surfsup.sph.kernel_sums import kernel_graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors


def test_the_largest_correction_is_five_meters_per_second():
    assert MAX_CORRECTION * DISPLACEMENT_SCALE / FRAME_TIME == 5.0


def test_small_corrections_do_not_change():
    velocity = torch.tensor([[0.0, 0.0, 0.0], [MAX_CORRECTION, 0.0, 0.0]])
    small = Correction(velocity, torch.tensor([[9.0, 0, 0], [7.0, 0, 0]]))
    torch.testing.assert_close(small.bounded().velocity, small.velocity)
    torch.testing.assert_close(small.bounded().position, small.position)


def test_a_large_correction_keeps_its_direction_and_its_share_of_displacement():
    large = Correction(torch.tensor([[0.0, 2 * MAX_CORRECTION, 0.0]]), torch.tensor([[1.0, 2.0, 3.0]])).bounded()
    torch.testing.assert_close(large.velocity, torch.tensor([[0.0, MAX_CORRECTION, 0.0]]))
    torch.testing.assert_close(large.position, torch.tensor([[0.5, 1.0, 1.5]]))


def test_a_correction_is_added_in_its_units():
    one = Correction(torch.tensor([[1.0, 0.0, 0.0]]), torch.tensor([[0.0, 1.0, 0.0]]))
    positions, velocities = one.added_to(torch.zeros(1, 3), torch.ones(1, 3))
    torch.testing.assert_close(positions, torch.tensor([[0.0, DISPLACEMENT_SCALE, 0.0]]))
    torch.testing.assert_close(velocities, torch.tensor([[1.0 + DISPLACEMENT_SCALE / FRAME_TIME, 1.0, 1.0]]))


def velocity_by_pressure(scaled_rate: list[float], output: list[float]) -> torch.Tensor:
    """The velocity corrections (2, 3) of two particles next to each other along x."""
    positions = torch.tensor([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]])
    graph = kernel_graph(positions, find_neighbors(positions, KERNEL_SUPPORT))
    substep = SimpleNamespace(
        graph=graph,
        density_gradient=GRADIENT_SCALE * graph.kernels[:, 1:],  # each has the other as its only neighbor
        density_rate=torch.tensor(scaled_rate) * DENSITY_SCALE / FRAME_TIME,
    )
    return Correction.from_pressure(torch.tensor(output), SimpleNamespace(substep=substep)).velocity


def test_a_pressure_pushes_both_particles_apart_equally():
    one, other = velocity_by_pressure([1.0, 0.0], [2.0, 3.0])
    assert one[0] < -0.1
    assert not one[1:].any()
    torch.testing.assert_close(other, -one)
    torch.testing.assert_close(velocity_by_pressure([2.0, 0.0], [1.0, 3.0])[0], one)  # proportional to the rate


def test_without_a_positive_density_rate_there_is_no_correction_and_nothing_attracts():
    assert not velocity_by_pressure([-1.0, 0.0], [2.0, 3.0]).any()
    assert not velocity_by_pressure([1.0, 1.0], [-2.0, -0.1]).any()
