import pytest
import torch

from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.noise import random_walk
from surfsup.learned.message_passing.normal import Moments, Normal
from surfsup.sph.state import SOLVER_STEPS, STEP_TIME
from tests.learned.message_passing.scenes import GRAVITY, water


def falling(frames: int, start: torch.Tensor, velocity: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Positions and end velocities (frames, 1, 3) as the solver falls."""
    positions, velocities = [start], [velocity]
    for _ in range(frames - 1):
        place, speed = positions[-1], velocities[-1]
        for _ in range(SOLVER_STEPS):
            speed = speed + STEP_TIME * GRAVITY.double()
            place = place + STEP_TIME * speed
        positions.append(place)
        velocities.append(speed)
    return torch.stack(positions), torch.stack(velocities)


@pytest.mark.parametrize(("steps", "stride"), [(4, 1), (1, 1), (3, 2), (2, 5)])
def test_the_unseen_past_was_an_exact_free_fall(steps, stride):
    start, velocity = torch.tensor([[0.1, 0.2, 1.5]]).double(), torch.tensor([[1.0, -2.0, 0.5]]).double()
    positions, velocities = falling(steps * stride + 1, start, velocity)
    true = History.of_frames(positions, velocities[-1], stride)
    assumed = History.in_free_fall(positions[-1], velocities[-1], GRAVITY.double(), steps, stride)
    assert assumed.moves.shape == (1, steps, 3)
    torch.testing.assert_close(assumed.moves, true.moves, atol=1e-12, rtol=0)


def test_moves_come_last_one_first():
    positions = torch.tensor([0.0, 1.0, 3.0, 7.0])[:, None, None].expand(4, 1, 3)
    history = History.of_frames(positions, torch.zeros(1, 3))
    assert history.moves[0, :, 0].tolist() == [4.0, 2.0, 1.0]
    later = history.moved_to(torch.full((1, 3), 15.0), torch.ones(1, 3))
    assert later.moves[0, :, 0].tolist() == [8.0, 4.0, 2.0]
    assert torch.equal(later.velocities, torch.ones(1, 3))


def test_noise_is_a_walk_whose_places_and_moves_agree():
    clean = water(4000, dtype=torch.float64)
    before = {name: value.clone() for name, value in vars(clean).items()}
    noisy, last = random_walk(clean, 1e-3, torch.Generator().manual_seed(0))
    walk = (noisy.moves - clean.moves).flip(1)
    torch.testing.assert_close(noisy.positions - clean.positions, walk.sum(dim=1))
    torch.testing.assert_close(walk[:, -1], last)
    spread = walk.std(dim=(0, 2))
    torch.testing.assert_close(spread, 1e-3 * torch.tensor([0.25, 0.5, 0.75, 1.0]).double().sqrt(), rtol=0.05, atol=0)
    assert all(torch.equal(value, before[name]) for name, value in vars(clean).items()), "what was given is as it was"


def test_noise_follows_its_generator():
    one, other, next_one = (
        random_walk(water(), 1e-3, generator)[0].moves
        for generator in (torch.Generator().manual_seed(7), torch.Generator().manual_seed(7), torch.Generator())
    )
    assert torch.equal(one, other)
    assert not torch.equal(one, next_one)


def test_a_normal_is_measured_in_portions_and_undoes_itself():
    values = torch.randn(1000, 4, 3, dtype=torch.float64) * torch.tensor([1.0, 2.0, 3.0]) + 5
    moments = Moments()
    for part in values.split(300):
        moments.add(part)
    normal = Normal([1.0, 1.0, 1.0]).double()
    normal.take(moments)
    torch.testing.assert_close(normal.mean, values.mean(dim=(0, 1)))
    torch.testing.assert_close(normal.spread, values.std(dim=(0, 1), correction=0))
    torch.testing.assert_close(normal.restore(normal.normalize(values)), values)


def test_what_never_changes_is_not_divided_by_zero():
    moments = Moments()
    moments.add(torch.zeros(10, 3))
    normal = Normal([1.0, 1.0, 1.0])
    normal.take(moments)
    assert torch.equal(normal.normalize(torch.zeros(2, 3)), torch.zeros(2, 3))
