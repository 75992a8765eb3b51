import numpy as np
import torch

from surfsup.sph.boundary.shape_functions import (
    NODES_OF_CELL,
    OTHERS_OF_CELL,
    from_nodes_to_others,
    places_in_cell,
    serendipity,
)


def test_each_function_of_a_cell_is_one_at_its_own_node_and_none_at_the_others():
    values, _ = serendipity(torch.from_numpy(places_in_cell(NODES_OF_CELL)))
    torch.testing.assert_close(values, torch.eye(32, dtype=torch.float64))


def test_their_slopes_are_those_of_finite_differences():
    at = 2 * torch.rand(6, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 1
    _, slopes = serendipity(at)
    for axis in range(3):
        step = 1e-6 * torch.eye(3, dtype=torch.float64)[axis]
        rise = (serendipity(at + step)[0] - serendipity(at - step)[0]) / 2e-6
        torch.testing.assert_close(slopes[:, axis], rise, atol=1e-7, rtol=0)


def test_between_its_nodes_a_cell_knows_what_is_linear_exactly():
    slope = np.array([0.3, -0.2, 0.7])
    np.testing.assert_allclose(from_nodes_to_others() @ (NODES_OF_CELL @ slope), OTHERS_OF_CELL @ slope, atol=1e-12)
    assert len(NODES_OF_CELL) + len(OTHERS_OF_CELL) == 4**3
