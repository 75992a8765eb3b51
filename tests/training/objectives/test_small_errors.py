import math

import pytest
import torch

from surfsup.training.objectives.small_errors import SMALL_ERROR, small_error_loss


def loss_of(error: float) -> float:
    return float(small_error_loss(torch.tensor([error**2])))


def test_the_loss_of_no_error_and_of_the_small_error():
    assert loss_of(0) == 0
    assert loss_of(SMALL_ERROR) == pytest.approx(math.log(2))


@pytest.mark.parametrize("error", [100 * SMALL_ERROR, 1000.0])
def test_halving_an_error_lowers_the_loss_equally_for_all_sizes(error):
    assert loss_of(error) - loss_of(error / 2) == pytest.approx(math.log(4), rel=2e-3)


def test_a_tiny_error_counts_nothing():
    assert loss_of(SMALL_ERROR / 100) < 1e-3


def test_the_loss_has_the_gradient_of_finite_differences():
    squared = torch.rand(6, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).requires_grad_()
    assert torch.autograd.gradcheck(small_error_loss, squared)
