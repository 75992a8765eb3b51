import numpy as np
import pytest
import torch

from surfsup.design.reward import Outcome, landing_near, log_density, near


def test_the_rewards_are_the_log_densities_of_the_paper():
    from scipy.stats import multivariate_normal

    points = torch.randn(7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    found = log_density(points, (0.1, 0.0, 0.5), 0.8)
    assert found.numpy() == pytest.approx(multivariate_normal([0.1, 0.0, 0.5], 0.8 * np.eye(3)).logpdf(points))
    landed = torch.zeros(7, dtype=torch.bool)
    assert near((0.1, 0.0, 0.5), 0.8)(Outcome(points, landed, {})) == found.mean()


def test_the_reward_of_the_funnel_counts_landed_particles_alone():
    points = torch.tensor([[0.1, 0.0, 0.06], [5.0, 5.0, 1.0]])
    end = Outcome(points, torch.tensor([True, False]), {})
    expected = float(log_density(points[:1, :2], (0.0, 0.0), 0.75))
    assert float(landing_near((0.0, 0.0), 0.75, 0.06)(end)) == pytest.approx(expected)
