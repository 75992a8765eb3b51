import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.sdf import Box, Difference, Sphere, Surface, Transformed, Union
from surfsup.sph.collision import CLEARANCE, TOLERANCE, LastQuery, resolve_collisions
from surfsup.sph.environment import Environment

LOWER, UPPER = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
HIGH = torch.tensor([0.0, 0.0, 1.8])  # free in every scene here


def environment_of(surface: Surface | None) -> Environment:
    return Environment(surface, LOWER, UPPER, torch.tensor([0.0, 0.0, -9.81]))


def at(surface: Surface, x: float, y: float, z: float) -> Surface:
    return Transformed(surface, None, (x, y, z))


class Counted(Surface):
    """A surface that counts the points of its queries."""

    def __init__(self, surface: Surface) -> None:
        super().__init__()
        self.surface, self.queries = surface, []

    def distance(self, points: torch.Tensor) -> torch.Tensor:
        self.queries.append(len(points))
        return self.surface.distance(points)

    def bounds(self) -> torch.Tensor:
        return self.surface.bounds()


SCENES = {
    "ball": at(Sphere(0.3), 0.0, 0.0, 0.3),
    "box": at(Box((0.4, 0.5, 0.3)), 0.1, 0.0, 0.15),
    "box against a wall": at(Box((0.3, 0.5, 0.5)), 0.35, 0.0, 0.25),
    "box in a corner": at(Box((0.4, 0.4, 0.4)), -0.3, -0.3, 0.2),
    "box almost at a wall": at(Box((0.8, 0.5, 0.5)), 0.08, 0.0, 0.25),
    "ball on a box": Union(at(Box((0.6, 0.6, 0.2)), 0, 0, 0.1), at(Sphere(0.2), 0, 0, 0.35)),
    "two balls that touch": Union(at(Sphere(0.2), -0.2, 0, 0.2), at(Sphere(0.2), 0.2, 0, 0.2)),
    "bowl": Difference(at(Sphere(0.4), 0, 0, 0.4), at(Sphere(0.35), 0, 0, 0.5)),
}


def random_particles(seed: int, count: int = 200) -> tuple[torch.Tensor, torch.Tensor]:
    """Positions in and around the container and velocities of several m/s."""
    random = torch.Generator().manual_seed(seed)
    span = (UPPER - LOWER) * torch.tensor([1.2, 1.2, 0.7])
    positions = LOWER - 0.1 + span * torch.rand(count, 3, generator=random)
    return positions, 3 * torch.randn(count, 3, generator=random)


@pytest.mark.parametrize("name", SCENES)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_no_particle_is_inside_or_outside_afterwards(name, seed):
    surface = SCENES[name]
    positions, velocities = random_particles(seed)
    kept = resolve_collisions(HIGH.expand_as(positions), positions, velocities, environment_of(surface))
    assert (surface.distance(kept.positions) >= 0).all()
    assert (kept.positions >= LOWER).all()
    assert (kept.positions <= UPPER).all()


@pytest.mark.skipif(not native.instruction_sets(), reason="the package was built without a compiler")
@pytest.mark.parametrize("name", [*SCENES, "nothing"])
def test_cpp_and_torch_agree(name, monkeypatch):
    environment = environment_of(SCENES.get(name))
    positions, velocities = random_particles(2, 2000)
    as_given = positions.clone(), velocities.clone()
    ours = resolve_collisions(HIGH.expand_as(positions), positions, velocities, environment)
    assert torch.equal(positions, as_given[0])
    assert torch.equal(velocities, as_given[1])
    monkeypatch.setattr(native, "instruction_sets", list)
    theirs = resolve_collisions(HIGH.expand_as(positions), positions, velocities, environment)
    # In a crease or at equal distances rounding may choose the other side.
    alike = (ours.positions - theirs.positions).abs().amax(dim=-1) < 1e-5
    assert alike.float().mean() > 0.99
    torch.testing.assert_close(ours.velocities[alike], theirs.velocities[alike], atol=1e-3, rtol=0)
    assert torch.equal(ours.collided, theirs.collided)


@pytest.mark.parametrize("use_native", [True, False])
@pytest.mark.parametrize("name", SCENES)
def test_a_query_from_nearby_does_not_change_the_result(name, use_native, monkeypatch):
    if not use_native:
        monkeypatch.setattr(native, "instruction_sets", list)
    surface, environment = SCENES[name], environment_of(SCENES[name])
    earlier, velocities = random_particles(3, 2000)
    positions = earlier + 0.02 * torch.randn(2000, 3, generator=torch.Generator().manual_seed(4))
    before = HIGH.expand_as(positions)
    anew = resolve_collisions(before, positions, velocities, environment)
    kept = resolve_collisions(before, positions, velocities, environment, LastQuery(earlier, surface.distance(earlier)))
    assert (surface.distance(kept.positions) >= 0).all()
    for ours, theirs in zip(vars(kept).values(), vars(anew).values(), strict=True):
        assert torch.equal(ours, theirs)


def test_only_particles_that_may_have_come_too_close_query_the_solid_again():
    ball = Counted(at(Sphere(0.3), 0.0, 0.0, 0.3))
    earlier = torch.tensor([[0.0, 0.0, 0.7], [0.0, 0.0, 0.62], [0.4, 0.0, 0.3], [0.0, 0.0, float("nan")]])
    positions = earlier + torch.tensor([0.0, 0.0, -0.017])
    resolve_collisions(
        earlier, positions, torch.zeros(4, 3), environment_of(ball), LastQuery(earlier, ball.distance(earlier))
    )
    # Two were 0.1 away and moved by 0.017. The third was 0.02 away, the position of the fourth is NaN: both may be
    # anywhere.
    assert ball.queries[1] == 2


@pytest.mark.parametrize("name", SCENES)
def test_particles_with_enough_clearance_do_not_change(name):
    surface = SCENES[name]
    positions, velocities = random_particles(1, 2000)
    clear = (surface.distance(positions) >= CLEARANCE) & (
        (positions >= LOWER + CLEARANCE) & (positions <= UPPER - CLEARANCE)
    ).all(dim=-1)
    assert 0 < clear.sum() < len(clear)
    kept = resolve_collisions(positions, positions, velocities, environment_of(surface))
    assert torch.equal(kept.positions[clear], positions[clear])
    assert torch.equal(kept.velocities[clear], velocities[clear])
    assert not kept.collided[clear].any()
    changed = (kept.positions != positions).any(dim=-1)
    assert kept.collided[changed].all()


def test_a_particle_in_a_ball_is_projected_along_the_radius_to_the_clearance():
    surface = Sphere(0.3)
    wide = Environment(surface, torch.full((3,), -2.0), torch.full((3,), 2.0), torch.zeros(3))
    direction = torch.nn.functional.normalize(torch.randn(50, 3), dim=-1)
    positions = direction * torch.linspace(0.1, 0.315, 50)[:, None]
    velocities = torch.randn(50, 3)
    kept = resolve_collisions(0.5 * direction, positions, velocities, wide)
    torch.testing.assert_close(kept.positions, direction * (0.3 + CLEARANCE), atol=1e-5, rtol=0)
    assert kept.collided.all()
    # Inward velocity is removed, tangential and outward velocity unchanged.
    outward = (velocities * direction).sum(-1, keepdim=True)
    expected = velocities - outward.clamp(max=0) * direction
    torch.testing.assert_close(kept.velocities, expected, atol=1e-4, rtol=0)
    assert ((kept.velocities * direction).sum(-1) > -1e-4).all()


def test_walls_remove_outward_velocity_and_keep_inward_velocity():
    positions = torch.tensor([[0.6, 0.0, 1.0], [0.6, 0.0, 1.0], [0.0, 0.0, -0.1], [0.1, 0.2, 0.3]])
    velocities = torch.tensor([[2.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [1.0, 1.0, -5.0], [9.0, 9.0, 9.0]])
    kept = resolve_collisions(positions, positions, velocities, environment_of(None))
    edge, floor = 0.5 - CLEARANCE, CLEARANCE
    torch.testing.assert_close(
        kept.positions, torch.tensor([[edge, 0, 1], [edge, 0, 1], [0, 0, floor], [0.1, 0.2, 0.3]])
    )
    expected = [[0.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [1.0, 1.0, 0.0], [9.0, 9.0, 9.0]]
    assert kept.velocities.tolist() == expected
    assert kept.collided.tolist() == [True, True, True, False]


def test_a_corner_between_box_and_wall_keeps_both_clearances():
    surface = at(Box((0.3, 1.0, 0.5)), 0.0, 0.0, 0.25)
    positions = torch.tensor([[0.12, 0.0, -0.05], [0.14, 0.49, 0.1], [0.16, 0.5, 0.01]])
    kept = resolve_collisions(
        HIGH.expand_as(positions), positions, torch.zeros_like(positions), environment_of(surface)
    )
    assert (surface.distance(kept.positions) >= CLEARANCE - 2 * TOLERANCE).all()
    assert (kept.positions >= LOWER + CLEARANCE - 1e-6).all()
    assert (kept.positions <= UPPER - CLEARANCE + 1e-6).all()


def test_in_a_crease_too_narrow_a_particle_returns_to_its_last_position():
    # Between the box's face at x = 0.49 and the wall at 0.5 there is no room for a particle.
    surface = at(Box((0.98, 1.0, 0.5)), 0.0, 0.0, 0.25)
    before = torch.tensor([[0.4, 0.0, 0.6], [0.3, 0.1, 0.7]])
    positions = torch.tensor([[0.495, 0.0, 0.2], [0.3, 0.1, 0.7]])
    kept = resolve_collisions(before, positions, torch.full_like(positions, -3.0), environment_of(surface))
    assert torch.equal(kept.positions, before)
    assert torch.equal(kept.velocities, torch.tensor([[0.0, 0.0, 0.0], [-3.0, -3.0, -3.0]]))
    assert kept.collided.tolist() == [True, False]


def test_where_the_distance_has_no_gradient_a_particle_returns_to_its_last_position():
    surface = at(Sphere(0.3), 0.0, 0.0, 1.0)
    before, center = torch.tensor([[0.0, 0.0, 1.5]]), torch.tensor([[0.0, 0.0, 1.0]])
    kept = resolve_collisions(before, center, torch.zeros(1, 3), environment_of(surface))
    assert torch.equal(kept.positions, before)


def test_gradients_of_a_projection_equal_finite_differences():
    radius = torch.tensor(0.3, dtype=torch.float64, requires_grad=True)
    positions = torch.tensor([[0.1, 0.2, 0.05], [0.25, 0.0, 0.1]], dtype=torch.float64, requires_grad=True)
    velocities = torch.tensor([[-1.0, -2.0, 0.3], [1.0, 0.5, -0.3]], dtype=torch.float64, requires_grad=True)
    wide = torch.full((3,), 2.0, dtype=torch.float64)

    def projected(radius, positions, velocities):
        kept = resolve_collisions(
            wide.expand(2, 3) / 2, positions, velocities, Environment(Sphere(radius), -wide, wide, wide)
        )
        return kept.positions, kept.velocities

    assert torch.autograd.gradcheck(projected, (radius, positions, velocities))
