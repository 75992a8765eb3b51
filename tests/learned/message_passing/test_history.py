import pytest
import torch

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.noise import add_random_walk
from surfsup.learned.message_passing.normalizer import Normalizer, RunningStatistics
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS
from tests.learned.message_passing.scenes import GRAVITY, water


def free_fall(frames: int, position: torch.Tensor, velocity: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Positions and end-of-frame velocities (frames, 1, 3) by the solver's substeps."""
    positions, velocities = [position], [velocity]
    for _ in range(frames - 1):
        for _ in range(SUBSTEPS):
            velocity = velocity + SUBSTEP_TIME * GRAVITY.double()
            position = position + SUBSTEP_TIME * velocity
        positions.append(position)
        velocities.append(velocity)
    return torch.stack(positions), torch.stack(velocities)


@pytest.mark.parametrize("length", [1, 4])
def test_the_initial_history_is_an_exact_free_fall(length):
    start, velocity = torch.tensor([[0.1, 0.2, 1.5]]).double(), torch.tensor([[1.0, -2.0, 0.5]]).double()
    positions, velocities = free_fall(length + 1, start, velocity)
    true = History.from_frames(positions, velocities[-1])
    assumed = History.in_free_fall(positions[-1], velocities[-1], GRAVITY.double(), length)
    assert assumed.displacements.shape == (1, length, 3)
    torch.testing.assert_close(assumed.displacements, true.displacements, atol=1e-12, rtol=0)


def test_the_latest_displacement_comes_first():
    positions = torch.tensor([0.0, 1.0, 3.0, 7.0])[:, None, None].expand(4, 1, 3)
    history = History.from_frames(positions, torch.zeros(1, 3))
    assert history.displacements[0, :, 0].tolist() == [4.0, 2.0, 1.0]
    later = history.moved_to(torch.full((1, 3), 15.0), torch.ones(1, 3))
    assert later.displacements[0, :, 0].tolist() == [8.0, 4.0, 2.0]
    assert torch.equal(later.velocities, torch.ones(1, 3))


def test_noise_is_a_random_walk_with_consistent_positions_and_displacements():
    clean = water(4000, dtype=torch.float64)
    before = {name: value.clone() for name, value in vars(clean).items()}
    noisy = add_random_walk(clean, 1e-3, torch.Generator().manual_seed(0))
    walk = (noisy.displacements - clean.displacements).flip(1)
    torch.testing.assert_close(noisy.positions - clean.positions, walk.sum(dim=1))
    std = walk.std(dim=(0, 2))
    torch.testing.assert_close(std, 1e-3 * torch.tensor([0.25, 0.5, 0.75, 1.0]).double().sqrt(), rtol=0.05, atol=0)
    assert torch.equal(noisy.velocities, clean.velocities)
    assert all(torch.equal(value, before[name]) for name, value in vars(clean).items()), "the input is not modified"


def test_noise_depends_on_the_generator_alone():
    one, same, other = (
        add_random_walk(water(), 1e-3, generator).displacements
        for generator in (torch.Generator().manual_seed(7), torch.Generator().manual_seed(7), torch.Generator())
    )
    assert torch.equal(one, same)
    assert not torch.equal(one, other)


def test_a_normalizer_takes_statistics_measured_in_batches_and_is_invertible():
    values = torch.randn(1000, 4, 3, dtype=torch.float64) * torch.tensor([1.0, 2.0, 3.0]) + 5
    statistics = RunningStatistics()
    for part in values.split(300):
        statistics.add(part)
    normalizer = Normalizer([1.0, 1.0, 1.0]).double()
    normalizer.set_statistics(statistics)
    torch.testing.assert_close(normalizer.mean, values.mean(dim=(0, 1)))
    torch.testing.assert_close(normalizer.std, values.std(dim=(0, 1), correction=0))
    torch.testing.assert_close(normalizer.denormalize(normalizer.normalize(values)), values)


def test_a_constant_is_not_divided_by_zero():
    statistics = RunningStatistics()
    statistics.add(torch.zeros(10, 3))
    normalizer = Normalizer([1.0, 1.0, 1.0])
    normalizer.set_statistics(statistics)
    assert torch.equal(normalizer.normalize(torch.zeros(2, 3)), torch.zeros(2, 3))
