import numpy as np
import torch

from surfsup.sph.boundary.shape_functions import (
    CELL_NODES,
    OTHER_POINTS,
    interpolation_matrix,
    local_coordinates,
    shape_functions,
)


def test_each_function_is_one_at_its_own_node_and_zero_at_the_others():
    values, _ = shape_functions(torch.from_numpy(local_coordinates(CELL_NODES)))
    torch.testing.assert_close(values, torch.eye(32, dtype=torch.float64))


def test_gradients_are_those_of_finite_differences():
    at = 2 * torch.rand(6, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 1
    _, gradients = shape_functions(at)
    for axis in range(3):
        step = 1e-6 * torch.eye(3, dtype=torch.float64)[axis]
        difference = (shape_functions(at + step)[0] - shape_functions(at - step)[0]) / 2e-6
        torch.testing.assert_close(gradients[:, axis], difference, atol=1e-7, rtol=0)


def test_a_linear_function_is_interpolated_exactly():
    slope = np.array([0.3, -0.2, 0.7])
    np.testing.assert_allclose(interpolation_matrix() @ (CELL_NODES @ slope), OTHER_POINTS @ slope, atol=1e-12)
    assert len(CELL_NODES) + len(OTHER_POINTS) == 4**3
