from itertools import pairwise

import pytest
import torch

from surfsup.design.rollout import GradientNotFinite, all_frames, crossing_point, last_frame
from surfsup.sdf import Bowl, Sphere, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState


def lattice(side: int, height: int, bottom: float, dtype: torch.dtype = torch.float32) -> torch.Tensor:
    axis = (torch.arange(side, dtype=dtype) - (side - 1) / 2) * 0.03
    return torch.cartesian_prod(axis, axis, bottom + 0.03 * torch.arange(height, dtype=dtype))


def make_environment(surface, dtype=torch.float32) -> Environment:
    corners = (torch.tensor(corner, dtype=dtype) for corner in ([-0.5, -0.5, 0.0], [0.5, 0.5, 2.0]))
    return Environment(surface, *corners, torch.tensor([0.0, 0.0, -9.81], dtype=dtype))


def falling(positions: torch.Tensor, speed: float = 1.0) -> ParticleState:
    return ParticleState(positions, torch.tensor([0.0, 0.0, -speed]).to(positions).expand_as(positions))


def bowl(capture, hole=0.0, height=0.5) -> Transformed:
    return Transformed(Bowl(capture, hole), translation=torch.tensor([0.0, 0.0, height]).to(torch.as_tensor(capture)))


def mean_squared_distance(positions: torch.Tensor) -> torch.Tensor:
    return (positions - positions.new_tensor([0.0, 0.0, 0.4])).square().sum(dim=-1).mean()


class TestGradientsEqualCentralDifferences:
    """In double precision, over frames in which water strikes the surface, so that all parts of a step take part.

    The reward has small jumps where a penetration exceeds the 10 µm from which collision handling moves a particle. A
    difference over 0.1 µm can include a jump and be off by a factor of 100. The differences here are over 10 nm, which
    double precision allows.
    """

    @pytest.mark.parametrize("frames", [1, 4, 9])
    def test_in_the_radii_of_a_bowl(self, simulator, frames):
        positions = lattice(5, 3, 0.46, torch.float64)

        def reward(capture, hole):
            environment = make_environment(bowl(capture, hole), torch.float64)
            return mean_squared_distance(last_frame(simulator, environment, falling(positions, 2.0), frames).positions)

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

    def test_in_the_position_of_a_ball(self, simulator):
        positions = lattice(5, 2, 0.56, torch.float64)

        def reward(center):
            ball = Transformed(Sphere(torch.tensor(0.1, dtype=torch.float64)), translation=center)
            end = last_frame(simulator, make_environment(ball, torch.float64), falling(positions), 6)
            return end.positions[:, 0].mean()

        center = torch.tensor([0.02, 0.0, 0.43], dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(reward(center), center)
        for axis in range(3):
            offset = torch.zeros(3, dtype=torch.float64)
            offset[axis] = 1e-8
            with torch.no_grad():
                slope = (reward(center + offset) - reward(center - offset)) / 2e-8
            assert float(gradient[axis]) == pytest.approx(float(slope), rel=1e-4, abs=1e-7)

    def test_in_the_initial_positions_and_velocities(self, simulator):
        positions, velocities = lattice(3, 2, 0.46, torch.float64), torch.zeros(18, 3, dtype=torch.float64)
        velocities[:, 2] = -2.0
        random = torch.Generator().manual_seed(0)
        direction = torch.randn(2, 18, 3, dtype=torch.float64, generator=random)

        def reward(distance):
            start = ParticleState(positions + distance * 1e-2 * direction[0], velocities + distance * direction[1])
            environment = make_environment(bowl(torch.tensor(0.1).double()), torch.float64)
            return mean_squared_distance(last_frame(simulator, environment, start, 5).positions)

        # Water on a lattice at a single velocity is where the pressure solve begins to act: the reward has a kink.
        distance = torch.full((), 0.3, dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(reward(distance), distance)
        with torch.no_grad():
            slope = (reward(distance + 1e-7) - reward(distance - 1e-7)) / 2e-7
        assert float(gradient) == pytest.approx(float(slope), rel=1e-4)

    def test_in_landing_positions(self, simulator):
        positions = lattice(3, 2, 0.2, torch.float64)

        def reward(center):
            ball = Transformed(Sphere(torch.tensor(0.03, dtype=torch.float64)), translation=center)
            environment = make_environment(ball, torch.float64)
            end = last_frame(simulator, environment, falling(positions, 3.0), 12, floor=0.06)
            assert end.landed.sum() > 0
            return end.positions[end.landed][:, 0].mean()

        center = torch.tensor([0.01, 0.003, 0.14], dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(reward(center), center)
        offset = torch.tensor([1e-8, 0.0, 0.0], dtype=torch.float64)
        with torch.no_grad():
            slope = (reward(center + offset) - reward(center - offset)) / 2e-8
        assert float(gradient[0]) == pytest.approx(float(slope), rel=1e-3)


class TestTheLastFrame:
    def test_is_the_same_with_and_without_gradients(self, simulator):
        start, capture = falling(lattice(5, 3, 0.46)), torch.tensor(0.12, requires_grad=True)
        with torch.no_grad():
            plain = last_frame(simulator, make_environment(bowl(0.12)), start, 12).positions
            *_, frame = all_frames(simulator, make_environment(bowl(0.12)), start, 12)
        recorded = last_frame(simulator, make_environment(bowl(capture)), start, 12).positions
        assert torch.equal(plain, recorded.detach()) and torch.equal(plain, frame.positions)
        assert recorded.requires_grad and not plain.requires_grad

    def test_has_the_same_gradient_for_every_segment_length(self, simulator, monkeypatch):
        def gradient(length: int) -> torch.Tensor:
            monkeypatch.setattr("surfsup.design.rollout.math.isqrt", lambda frames: length)
            capture = torch.tensor(0.12, requires_grad=True)
            end = last_frame(simulator, make_environment(bowl(capture)), falling(lattice(4, 2, 0.46), 2.0), 6)
            return torch.autograd.grad(mean_squared_distance(end.positions), capture)[0]

        assert float(gradient(6)) == pytest.approx(float(gradient(1)), rel=1e-3)


class Unfollowable(DfsphSolver):
    """The solver, but the gradient is lost in the frame that begins with the first particle just above a height."""

    def __init__(self, height: float) -> None:
        super().__init__()
        self.height = height

    def step(self, state, environment, handle_collisions=True):
        after, collided = super().step(state, environment, handle_collisions)
        if after.positions.requires_grad and after.positions[0, 2] < self.height <= state.positions[0, 2]:
            after = ParticleState(Lost.apply(after.positions), after.velocities)
        return after, collided


class Lost(torch.autograd.Function):
    @staticmethod
    def forward(ctx, values):
        return values.clone()

    @staticmethod
    def backward(ctx, gradient):
        return gradient * torch.nan


@pytest.mark.parametrize("frame", range(1, 11))
def test_a_gradient_that_is_not_finite_is_reported_with_its_frame(frame):
    positions = torch.tensor([[0.0, 0.0, 0.9], [0.4, 0.4, 1.4]], requires_grad=True)
    start, environment = falling(positions, 2.0), make_environment(None)
    with torch.no_grad():
        heights = [float(now.positions[0, 2]) for now in all_frames(DfsphSolver(), environment, start, 10)]
    end = last_frame(Unfollowable((heights[frame - 1] + heights[frame]) / 2), environment, start, 10)
    with pytest.raises(GradientNotFinite, match=rf"cannot be followed back through frame {frame};"):
        end.positions.sum().backward()


class TestLandedParticles:
    start, floor = falling(lattice(3, 6, 0.08), 2.0), 0.06

    def test_keep_their_landing_position_and_their_order(self, simulator):
        frames = list(all_frames(simulator, make_environment(None), self.start, 20, self.floor))
        for before, after in pairwise(frames):
            assert torch.equal(after.positions[before.landed], before.positions[before.landed])
            assert not bool((before.landed & ~after.landed).any())
        last = frames[-1]
        assert last.landed.sum() > 0 and torch.allclose(last.positions[last.landed][:, 2], torch.tensor(0.06))
        # Neighbors hardly push particles aside in free fall: particle i is still above its own initial position.
        assert (last.positions - self.start.positions)[:, :2].abs().max() < 0.03

    def test_are_no_longer_simulated(self, simulator):
        *_, last = all_frames(simulator, make_environment(None), self.start, 60, self.floor)
        assert last.landed.all() and len(last.active) == 0 and len(last.state.positions) == 0

    def test_may_be_all_particles_of_a_differentiable_rollout(self, simulator):
        center = torch.tensor([0.01, 0.0, 0.3], requires_grad=True)
        environment = make_environment(Transformed(Sphere(0.04), translation=center))
        end = last_frame(simulator, environment, falling(lattice(3, 2, 0.4), 3.0), 120, floor=0.06)
        assert end.landed.all()
        (gradient,) = torch.autograd.grad(end.positions[:, 0].mean(), center)
        assert torch.isfinite(gradient).all() and gradient.abs().max() > 0

    def test_land_where_their_path_crosses_the_floor(self):
        before, after = torch.tensor([[0.0, 0.0, 0.10]]), torch.tensor([[0.08, 0.04, 0.02]])
        assert torch.allclose(crossing_point(before, after, 0.06), torch.tensor([[0.04, 0.02, 0.06]]))

    def test_that_start_below_the_floor_land_where_they_are(self):
        before, after = torch.tensor([[0.1, 0.0, 0.05]]), torch.tensor([[0.2, 0.0, 0.05]])
        assert torch.allclose(crossing_point(before, after, 0.06), torch.tensor([[0.2, 0.0, 0.06]]))
