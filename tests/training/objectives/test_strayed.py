import torch

from surfsup.training.objectives.strayed import at_most


def test_longer_vectors_are_shortened_and_others_left():
    vectors = torch.tensor([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, -1.0]])
    expected = torch.tensor([[0.0, 0.0, 0.0], [1.2, 1.6, 0.0], [0.0, 0.0, -1.0]])
    torch.testing.assert_close(at_most(vectors, 2.0), expected)
