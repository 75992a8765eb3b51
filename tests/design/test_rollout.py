from dataclasses import replace
from itertools import pairwise

import pytest
import torch

from surfsup.design.rollout import Water, crossing, every_frame, last_frame
from surfsup.sdf import Bowl, Sphere, Transformed
from surfsup.sph.state import Environment


def lattice(side: int, tall: int, bottom: float, dtype: torch.dtype = torch.float32) -> torch.Tensor:
    axis = (torch.arange(side, dtype=dtype) - (side - 1) / 2) * 0.03
    return torch.cartesian_prod(axis, axis, bottom + 0.03 * torch.arange(tall, dtype=dtype))


def around(surface, dtype=torch.float32) -> Environment:
    corners = (torch.tensor(corner, dtype=dtype) for corner in ([-0.5, -0.5, 0.0], [0.5, 0.5, 2.0]))
    return Environment(surface, *corners, torch.tensor([0.0, 0.0, -9.81], dtype=dtype))


def falling(positions: torch.Tensor, speed: float = 1.0, **more) -> Water:
    return Water(positions, torch.tensor([0.0, 0.0, -speed]).to(positions).expand_as(positions), **more)


def bowl(capture, hole=0.0, height=0.5) -> Transformed:
    return Transformed(Bowl(capture, hole), translation=torch.tensor([0.0, 0.0, height]).to(torch.as_tensor(capture)))


def spread(positions: torch.Tensor) -> torch.Tensor:
    return (positions - positions.new_tensor([0.0, 0.0, 0.4])).square().sum(dim=-1).mean()


class TestGradientsEqualCentralDifferences:
    """In double precision, over frames in which water strikes the solid: guard, network and ballistic motion take part.

    The reward jumps a little where a particle becomes so deep (10 µm) that the guard moves it: a difference over 0.1 µm
    may span a jump and be off by a hundred times (seen). So the steps are 10 nm; double precision allows that.
    """

    @pytest.fixture
    def exact(self, simulator):
        from copy import deepcopy

        return deepcopy(simulator).double()

    @pytest.mark.parametrize("frames", [1, 4, 9])
    def test_in_the_radii_of_a_bowl(self, exact, frames):
        positions = lattice(5, 3, 0.46, torch.float64)

        def reward(capture, hole):
            water = falling(positions, 2.0)
            return spread(last_frame(exact, around(bowl(capture, hole), torch.float64), water, frames).positions)

        radii = [torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in (0.11, 0.045)]
        gradients = torch.autograd.grad(reward(*radii), radii)
        step = 1e-8
        for number, gradient in enumerate(gradients):
            with torch.no_grad():
                ends = [
                    reward(*(r + sign * step if n == number else r for n, r in enumerate(radii))) for sign in (1, -1)
                ]
            assert float(gradient) == pytest.approx(float(ends[0] - ends[1]) / (2 * step), rel=1e-4, abs=1e-8)
        assert gradients[0].abs() > 1e-6

    def test_in_the_place_of_a_ball(self, exact):
        positions = lattice(5, 2, 0.56, torch.float64)

        def reward(place):
            ball = Transformed(Sphere(torch.tensor(0.1, dtype=torch.float64)), translation=place)
            return last_frame(exact, around(ball, torch.float64), falling(positions), 6).positions[:, 0].mean()

        place = torch.tensor([0.02, 0.0, 0.43], dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(reward(place), place)
        for axis in range(3):
            offset = torch.zeros(3, dtype=torch.float64)
            offset[axis] = 1e-8
            with torch.no_grad():
                slope = (reward(place + offset) - reward(place - offset)) / 2e-8
            assert float(gradient[axis]) == pytest.approx(float(slope), rel=1e-4, abs=1e-7)

    def test_in_where_and_how_fast_the_water_starts(self, exact):
        positions, velocities = lattice(3, 2, 0.46, torch.float64), torch.zeros(18, 3, dtype=torch.float64)
        velocities[:, 2] = -2.0
        random = torch.Generator().manual_seed(0)
        aside = torch.randn(2, 18, 3, dtype=torch.float64, generator=random)

        def reward(share):
            water = Water(positions + share * 1e-2 * aside[0], velocities + share * aside[1])
            return spread(
                last_frame(exact, around(bowl(torch.tensor(0.1).double()), torch.float64), water, 5).positions
            )

        # On its lattice, at one velocity, water is at the edge of what sweeps do nothing to: there is no slope.
        share = torch.full((), 0.3, dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(reward(share), share)
        with torch.no_grad():
            slope = (reward(share + 1e-7) - reward(share - 1e-7)) / 2e-7
        assert float(gradient) == pytest.approx(float(slope), rel=1e-4)

    def test_in_where_particles_land(self, exact):
        positions = lattice(3, 2, 0.2, torch.float64)

        def reward(place):
            ball = Transformed(Sphere(torch.tensor(0.03, dtype=torch.float64)), translation=place)
            end = last_frame(exact, around(ball, torch.float64), falling(positions, 3.0, floor=0.06), 12)
            assert end.landed.sum() > 0
            return end.positions[end.landed][:, 0].mean()

        place = torch.tensor([0.01, 0.003, 0.14], dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(reward(place), place)
        offset = torch.tensor([1e-8, 0.0, 0.0], dtype=torch.float64)
        with torch.no_grad():
            slope = (reward(place + offset) - reward(place - offset)) / 2e-8
        assert float(gradient[0]) == pytest.approx(float(slope), rel=1e-3)


class TestALastFrame:
    def test_is_that_of_a_rollout_with_or_without_gradients(self, simulator):
        water, capture = falling(lattice(5, 3, 0.46)), torch.tensor(0.12, requires_grad=True)
        with torch.no_grad():
            plain = last_frame(simulator, around(bowl(0.12)), water, 12).positions
            *_, frame = every_frame(simulator, around(bowl(0.12)), water, 12)
        recorded = last_frame(simulator, around(bowl(capture)), water, 12).positions
        assert torch.equal(plain, recorded.detach()) and torch.equal(plain, frame.positions)
        assert recorded.requires_grad and not plain.requires_grad

    def test_has_the_same_gradient_whatever_the_stretches(self, simulator, monkeypatch):
        def gradient(length: int) -> torch.Tensor:
            monkeypatch.setattr("surfsup.design.rollout.math.isqrt", lambda frames: length)
            capture = torch.tensor(0.12, requires_grad=True)
            end = last_frame(simulator, around(bowl(capture)), falling(lattice(4, 2, 0.46), 2.0), 6)
            return torch.autograd.grad(spread(end.positions), capture)[0]

        assert float(gradient(6)) == pytest.approx(float(gradient(1)), rel=1e-3)


class TestParticlesThatLeave:
    water = falling(lattice(3, 6, 0.08), 2.0, floor=0.06)

    def test_stay_where_they_landed_and_in_their_order(self, small_simulator):
        frames = list(every_frame(small_simulator, around(None), self.water, 20))
        for before, after in pairwise(frames):
            assert torch.equal(after.positions[before.landed], before.positions[before.landed])
            assert not bool((before.landed & ~after.landed).any())
        last = frames[-1]
        assert last.landed.sum() > 0 and torch.allclose(last.positions[last.landed][:, 2], torch.tensor(0.06))
        # No neighbor has pushed far aside what fell freely: particle i is still the one above its own place.
        assert (last.positions - self.water.positions)[:, :2].abs().max() < 0.03

    def test_are_no_longer_simulated(self, small_simulator):
        *_, last = every_frame(small_simulator, around(None), self.water, 60)
        assert last.landed.all() and len(last.members) == 0 and len(last.state.positions) == 0

    def test_may_all_leave_on_the_way_of_a_gradient(self, small_simulator):
        place = torch.tensor([0.01, 0.0, 0.3], requires_grad=True)
        water = falling(lattice(3, 2, 0.4), 3.0, floor=0.06)
        end = last_frame(small_simulator, around(Transformed(Sphere(0.04), translation=place)), water, 120)
        assert end.landed.all()
        (gradient,) = torch.autograd.grad(end.positions[:, 0].mean(), place)
        assert torch.isfinite(gradient).all() and gradient.abs().max() > 0

    def test_land_where_their_way_meets_the_floor(self):
        before, after = torch.tensor([[0.0, 0.0, 0.10]]), torch.tensor([[0.08, 0.04, 0.02]])
        assert torch.allclose(crossing(before, after, 0.06), torch.tensor([[0.04, 0.02, 0.06]]))

    def test_below_the_floor_from_the_start_land_where_they_are(self):
        before, after = torch.tensor([[0.1, 0.0, 0.05]]), torch.tensor([[0.2, 0.0, 0.05]])
        assert torch.allclose(crossing(before, after, 0.06), torch.tensor([[0.2, 0.0, 0.06]]))


class TestParticlesThatEnter:
    first, second = lattice(3, 2, 0.3), lattice(3, 2, 0.6)

    def poured(self, **more) -> Water:
        water = falling(self.first, **more)
        return replace(water, entering={4: (self.second, torch.zeros_like(self.second))})

    def test_wait_at_their_place_and_come_last(self, small_simulator):
        frames = list(every_frame(small_simulator, around(None), self.poured(), 8))
        assert all(torch.equal(frame.positions[18:], self.second) for frame in frames[:5])
        assert [len(frame.members) for frame in frames] == [18] * 4 + [36] * 5
        assert bool((frames[8].positions[18:, 2] < self.second[:, 2]).all())

    def test_carry_gradients_too(self, simulator):
        capture = torch.tensor(0.12, requires_grad=True)
        water = falling(lattice(3, 1, 0.45), 2.0)
        late = lattice(3, 2, 0.47)
        water = replace(water, entering={3: (late, torch.tensor([0.0, 0.0, -2.0]).expand_as(late))})
        end = last_frame(simulator, around(bowl(capture)), water, 12)
        (gradient,) = torch.autograd.grad(end.positions[9:, 2].mean(), capture)
        assert gradient != 0

    def test_while_others_leave(self, small_simulator):
        *_, last = every_frame(small_simulator, around(None), self.poured(floor=0.25), 30)
        assert last.landed[:18].all() and not last.landed[18:].any()
        assert last.members.tolist() == list(range(18, 36))
