import torch
from torch import nn

from surfsup.optim.averaging import update_average


def linear(value: float) -> nn.Linear:
    layer = nn.Linear(1, 1, bias=False)
    nn.init.constant_(layer.weight, value)
    return layer


def test_a_late_step_moves_the_average_by_one_minus_the_decay():
    average, model = linear(0.0), linear(1.0)
    update_average(average, model, step=100_000, decay=0.9)
    torch.testing.assert_close(average.weight, torch.full((1, 1), 0.1))


def test_the_first_step_keeps_only_a_tenth_of_the_initial_weights():
    average, model = linear(0.0), linear(1.0)
    update_average(average, model, step=0, decay=0.999)
    torch.testing.assert_close(average.weight, torch.full((1, 1), 0.9))
