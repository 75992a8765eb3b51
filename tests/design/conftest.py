import pytest

from surfsup.learned import weights_file
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator


@pytest.fixture(scope="session")
def simulator() -> CorrectedSimulator:
    return weights_file.load(weights_file.find(weights_file.DEFAULT_MODEL))[0]


@pytest.fixture(scope="session")
def small_simulator() -> CorrectedSimulator:
    """Of random weights: what is tested with it holds of any."""
    import torch

    torch.manual_seed(0)
    return CorrectedSimulator(Architecture(width=16, layers=2)).eval().requires_grad_(False)
