import torch

from surfsup.training.objectives.drift import HALF_WEIGHT_DRIFT, clamp_length, drift_weight


def test_only_longer_vectors_are_scaled_down():
    vectors = torch.tensor([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, -1.0]])
    expected = torch.tensor([[0.0, 0.0, 0.0], [1.2, 1.6, 0.0], [0.0, 0.0, -1.0]])
    torch.testing.assert_close(clamp_length(vectors, 2.0), expected)


def test_the_weight_of_an_error_falls_with_the_drift():
    drift = torch.tensor([[0.0, 0.0, 0.0], [0.0, HALF_WEIGHT_DRIFT, 0.0], [0.0, 0.0, -3 * HALF_WEIGHT_DRIFT]])
    torch.testing.assert_close(drift_weight(drift), torch.tensor([1.0, 0.5, 0.1]))
