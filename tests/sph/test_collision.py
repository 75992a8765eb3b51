import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.sdf import Box, Difference, Sphere, Surface, Transformed, Union
from surfsup.sph.collision import CLEARANCE, TOLERANCE, Look, resolve_collisions
from surfsup.sph.state import Environment

LOWER, UPPER = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
HIGH = torch.tensor([0.0, 0.0, 1.8])  # a place that is free in every scene here


def around(surface: Surface | None) -> Environment:
    return Environment(surface, LOWER, UPPER, torch.tensor([0.0, 0.0, -9.81]))


def at(surface: Surface, x: float, y: float, z: float) -> Surface:
    return Transformed(surface, None, (x, y, z))


class Counted(Surface):
    """A surface that notes how many points it is asked about."""

    def __init__(self, surface: Surface) -> None:
        super().__init__()
        self.surface, self.asked = surface, []

    def distance(self, points: torch.Tensor) -> torch.Tensor:
        self.asked.append(len(points))
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


def drawn(seed: int, count: int = 200) -> tuple[torch.Tensor, torch.Tensor]:
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
    positions, velocities = drawn(seed)
    kept = resolve_collisions(HIGH.expand_as(positions), positions, velocities, around(surface))
    assert (surface.distance(kept.positions) >= 0).all()
    assert (kept.positions >= LOWER).all()
    assert (kept.positions <= UPPER).all()


@pytest.mark.skipif(
    not native.instruction_sets(), reason="the package was built without a compiler, so there is no native step"
)
@pytest.mark.parametrize("name", [*SCENES, "nothing"])
def test_native_parts_do_what_torch_does(name, monkeypatch):
    place = around(SCENES.get(name))
    positions, velocities = drawn(2, 2000)
    as_given = positions.clone(), velocities.clone()
    ours = resolve_collisions(HIGH.expand_as(positions), positions, velocities, place)
    assert torch.equal(positions, as_given[0])
    assert torch.equal(velocities, as_given[1])
    monkeypatch.setattr(native, "instruction_sets", list)
    theirs = resolve_collisions(HIGH.expand_as(positions), positions, velocities, place)
    # In a crease or at equal distances rounding may send a particle the other way.
    alike = (ours.positions - theirs.positions).abs().amax(dim=-1) < 1e-5
    assert alike.float().mean() > 0.99
    torch.testing.assert_close(ours.velocities[alike], theirs.velocities[alike], atol=1e-3, rtol=0)
    assert torch.equal(ours.moved, theirs.moved)


@pytest.mark.parametrize("native_parts", [True, False])
@pytest.mark.parametrize("name", SCENES)
def test_a_look_at_the_solid_from_nearby_changes_nothing_that_is_kept(name, native_parts, monkeypatch):
    if not native_parts:
        monkeypatch.setattr(native, "instruction_sets", list)
    surface, place = SCENES[name], around(SCENES[name])
    places, velocities = drawn(3, 2000)
    positions = places + 0.02 * torch.randn(2000, 3, generator=torch.Generator().manual_seed(4))
    before = HIGH.expand_as(positions)
    anew = resolve_collisions(before, positions, velocities, place)
    kept = resolve_collisions(before, positions, velocities, place, Look(places, surface.distance(places)))
    assert (surface.distance(kept.positions) >= 0).all()
    for ours, theirs in zip(vars(kept).values(), vars(anew).values(), strict=True):
        assert torch.equal(ours, theirs)


def test_only_those_are_looked_at_again_that_may_have_come_too_close():
    ball = Counted(at(Sphere(0.3), 0.0, 0.0, 0.3))
    places = torch.tensor([[0.0, 0.0, 0.7], [0.0, 0.0, 0.62], [0.4, 0.0, 0.3], [0.0, 0.0, float("nan")]])
    positions = places + torch.tensor([0.0, 0.0, -0.02])
    resolve_collisions(places, positions, torch.zeros(4, 3), around(ball), Look(places, ball.distance(places)))
    # Two were 0.1 away and went 0.02; the one that was 0.02 away and the one that is nowhere may be anywhere.
    assert ball.asked[1] == 2


@pytest.mark.parametrize("name", SCENES)
def test_who_was_not_in_the_way_is_not_touched(name):
    surface = SCENES[name]
    positions, velocities = drawn(1, 2000)
    clear = (surface.distance(positions) >= CLEARANCE) & (
        (positions >= LOWER + CLEARANCE) & (positions <= UPPER - CLEARANCE)
    ).all(dim=-1)
    assert 0 < clear.sum() < len(clear)
    kept = resolve_collisions(HIGH.expand_as(positions), positions, velocities, around(surface))
    assert torch.equal(kept.positions[clear], positions[clear])
    assert torch.equal(kept.velocities[clear], velocities[clear])
    assert not kept.moved[clear].any()
    changed = (kept.positions != positions).any(dim=-1)
    assert kept.moved[changed].all()


def test_a_particle_in_a_ball_is_pushed_out_along_the_radius_to_the_clearance():
    surface = Sphere(0.3)
    wide = Environment(surface, torch.full((3,), -2.0), torch.full((3,), 2.0), torch.zeros(3))
    direction = torch.nn.functional.normalize(torch.randn(50, 3), dim=-1)
    positions = direction * torch.linspace(0.1, 0.315, 50)[:, None]
    velocities = torch.randn(50, 3)
    kept = resolve_collisions(torch.full_like(positions, 1.0), positions, velocities, wide)
    torch.testing.assert_close(kept.positions, direction * (0.3 + CLEARANCE), atol=1e-5, rtol=0)
    assert kept.moved.all()
    # What pointed in is gone, what pointed along or out is as it was.
    outward = (velocities * direction).sum(-1, keepdim=True)
    expected = velocities - outward.clamp(max=0) * direction
    torch.testing.assert_close(kept.velocities, expected, atol=1e-4, rtol=0)
    assert ((kept.velocities * direction).sum(-1) > -1e-4).all()


def test_walls_stop_what_would_leave_and_leave_what_comes_back():
    positions = torch.tensor([[0.6, 0.0, 1.0], [0.6, 0.0, 1.0], [0.0, 0.0, -0.1], [0.1, 0.2, 0.3]])
    velocities = torch.tensor([[2.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [1.0, 1.0, -5.0], [9.0, 9.0, 9.0]])
    kept = resolve_collisions(positions, positions, velocities, around(None))
    edge, floor = 0.5 - CLEARANCE, CLEARANCE
    torch.testing.assert_close(
        kept.positions, torch.tensor([[edge, 0, 1], [edge, 0, 1], [0, 0, floor], [0.1, 0.2, 0.3]])
    )
    expected = [[0.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [1.0, 1.0, 0.0], [9.0, 9.0, 9.0]]
    assert kept.velocities.tolist() == expected
    assert kept.moved.tolist() == [True, True, True, False]


def test_a_corner_between_box_and_wall_keeps_both_clearances():
    surface = at(Box((0.3, 1.0, 0.5)), 0.0, 0.0, 0.25)
    positions = torch.tensor([[0.12, 0.0, -0.05], [0.14, 0.49, 0.1], [0.16, 0.5, 0.01]])
    kept = resolve_collisions(HIGH.expand_as(positions), positions, torch.zeros_like(positions), around(surface))
    assert (surface.distance(kept.positions) >= CLEARANCE - 2 * TOLERANCE).all()
    assert (kept.positions >= LOWER + CLEARANCE - 1e-6).all()
    assert (kept.positions <= UPPER - CLEARANCE + 1e-6).all()


def test_in_a_crease_too_narrow_a_particle_stays_where_it_was():
    # Between the box's face at x = 0.49 and the wall at 0.5 there is no room for a particle.
    surface = at(Box((0.98, 1.0, 0.5)), 0.0, 0.0, 0.25)
    before = torch.tensor([[0.4, 0.0, 0.6], [0.3, 0.1, 0.7]])
    positions = torch.tensor([[0.495, 0.0, 0.2], [0.3, 0.1, 0.7]])
    kept = resolve_collisions(before, positions, torch.full_like(positions, -3.0), around(surface))
    assert torch.equal(kept.positions, before)
    assert torch.equal(kept.velocities, torch.tensor([[0.0, 0.0, 0.0], [-3.0, -3.0, -3.0]]))
    assert kept.moved.tolist() == [True, False]


def test_where_the_distance_has_no_direction_a_particle_stays_where_it_was():
    surface = at(Sphere(0.3), 0.0, 0.0, 1.0)
    before, center = torch.tensor([[0.0, 0.0, 1.5]]), torch.tensor([[0.0, 0.0, 1.0]])
    kept = resolve_collisions(before, center, torch.zeros(1, 3), around(surface))
    assert torch.equal(kept.positions, before)


def test_gradients_of_a_push_are_those_of_finite_differences():
    radius = torch.tensor(0.3, dtype=torch.float64, requires_grad=True)
    positions = torch.tensor([[0.1, 0.2, 0.05], [0.25, 0.0, 0.1]], dtype=torch.float64, requires_grad=True)
    velocities = torch.tensor([[-1.0, -2.0, 0.3], [1.0, 0.5, -0.3]], dtype=torch.float64, requires_grad=True)
    wide = torch.full((3,), 2.0, dtype=torch.float64)

    def pushed(radius, positions, velocities):
        kept = resolve_collisions(
            wide.expand(2, 3) / 2, positions, velocities, Environment(Sphere(radius), -wide, wide, wide)
        )
        return kept.positions, kept.velocities

    assert torch.autograd.gradcheck(pushed, (radius, positions, velocities))
