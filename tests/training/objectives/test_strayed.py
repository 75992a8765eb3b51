import torch

from surfsup.training.objectives.strayed import UNSURE, at_most, weight_of


def test_longer_vectors_are_shortened_and_others_left():
    vectors = torch.tensor([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, -1.0]])
    expected = torch.tensor([[0.0, 0.0, 0.0], [1.2, 1.6, 0.0], [0.0, 0.0, -1.0]])
    torch.testing.assert_close(at_most(vectors, 2.0), expected)


def test_the_farther_a_particle_has_strayed_the_less_its_error_counts():
    strayed = torch.tensor([[0.0, 0.0, 0.0], [0.0, UNSURE, 0.0], [0.0, 0.0, -3 * UNSURE]])
    torch.testing.assert_close(weight_of(strayed), torch.tensor([1.0, 0.5, 0.1]))
