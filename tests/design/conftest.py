import pytest

from surfsup.model import weights
from surfsup.model.simulator import Architecture, Simulator


@pytest.fixture(scope="session")
def simulator() -> Simulator:
    return weights.load(weights.find(weights.DEFAULT_MODEL))[0]


@pytest.fixture(scope="session")
def small_simulator() -> Simulator:
    """Of random weights: what is tested with it holds of any."""
    import torch

    torch.manual_seed(0)
    return Simulator(Architecture(width=16, layers=2)).eval().requires_grad_(False)
