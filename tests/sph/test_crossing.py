"""No particle passes through a solid that stands still, however thin and fast."""

import numpy as np
import pytest
import torch

import surfsup as sf
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.sdf import Box, Sphere, Transformed, Union
from surfsup.sph.collision import CLEARANCE, resolve_collisions
from surfsup.sph.environment import Environment
from surfsup.sph.warp_engine import collision as warp_collision

LOWER, UPPER = torch.tensor([-0.6, -0.6, 0.0]), torch.tensor([0.6, 0.6, 2.0])
ENGINES = {"warp": lambda *arguments: warp_collision.resolve_collisions(*arguments, None)}
if is_built():
    ENGINES["c++"] = resolve_collisions
every_engine = pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
PLATE = Transformed(Box((0.8, 0.8, 0.0005)), None, (0.0, 0.0, 1.0))


def environment_of(surface):
    return Environment(surface, LOWER, UPPER, torch.tensor([0.0, 0.0, -9.81]))


def falling(count=400, seed=0):
    """Particles above the plate, and below it, or still in it, a frame later."""
    random = torch.Generator().manual_seed(seed)
    before = torch.rand(count, 3, generator=random) * torch.tensor([0.7, 0.7, 0.05]) + torch.tensor(
        [-0.35, -0.35, 1.021]
    )
    after = before + torch.randn(count, 3, generator=random) * 0.02 - torch.tensor([0.0, 0.0, 0.1])
    return before, after, (after - before) / 0.005


@every_engine
def test_a_particle_whose_path_leads_through_a_plate_stays_on_its_side(engine):
    before, after, velocities = falling()
    through = after[:, 2] < 1.0
    assert through.sum() > 300
    result = engine(before, after, velocities, environment_of(PLATE))
    assert (result.positions[:, 2] >= 1.0 + CLEARANCE).all()
    assert result.collided[through].all()
    assert (result.velocities[through, 2] >= 0).all()
    torch.testing.assert_close(result.velocities[through, :2], velocities[through, :2])


@every_engine
def test_paths_beside_a_solid_and_slow_ones_stay_as_they_are(engine):
    before, after, velocities = falling()
    shifted = torch.tensor([0.5, 0.0, 0.0])
    beside = (before + shifted)[:, 0] > 0.45
    kept = beside & ((after + shifted)[:, 0] > 0.45) & ((after + shifted)[:, 0] < 0.58)
    assert kept.sum() > 20
    result = engine(before + shifted, after + shifted, velocities, environment_of(PLATE))
    assert torch.equal(result.positions[kept], (after + shifted)[kept])
    slow = before + 0.15 * (after - before)
    above = slow[:, 2] > 1.0 + 1.01 * CLEARANCE
    result = engine(before, slow, velocities, environment_of(PLATE))
    assert above.any() and torch.equal(result.positions[above], slow[above])


@every_engine
def test_a_particle_that_projection_would_move_to_the_other_side_stays_on_its_own(engine):
    before = torch.tensor([[0.0, 0.0, 1.05], [0.1, 0.0, 1.05]])
    after = torch.tensor([[0.0, 0.0, 0.995], [0.1, 0.0, 1.01]])
    velocities = (after - before) / 0.005
    result = engine(before, after, velocities, environment_of(PLATE))
    np.testing.assert_allclose(result.positions[:, 2].numpy(), 1.0 + 0.00025 + CLEARANCE, atol=2e-5)


@pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
@pytest.mark.parametrize("name", ["plate", "two plates", "ball"])
def test_both_engines_agree(name):
    surface = {
        "plate": PLATE,
        "two plates": Union(PLATE, Transformed(Box((0.8, 0.8, 0.001)), None, (0.0, 0.0, 0.94))),
        "ball": Transformed(Sphere(0.04), None, (0.0, 0.0, 0.98)),
    }[name]
    results = [engine(*falling(2000, seed=3), environment_of(surface)) for engine in ENGINES.values()]
    torch.testing.assert_close(results[0].positions, results[1].positions, atol=2e-6, rtol=0)
    torch.testing.assert_close(results[0].velocities, results[1].velocities, atol=1e-3, rtol=0)
    assert torch.equal(results[0].collided, results[1].collided)


def test_gradients_pass_a_path_that_was_cut():
    before, after, velocities = (value.double()[:20] for value in falling())
    before, after = before.requires_grad_(), after.requires_grad_()
    surface = Transformed(Box((0.8, 0.8, 0.0005)), None, (0.0, 0.0, 1.0)).double()
    environment = Environment(surface, LOWER.double(), UPPER.double(), torch.zeros(3, dtype=torch.float64))
    result = warp_collision.resolve_collisions(before, after, velocities, environment, None)
    result.positions.sum().backward()
    assert torch.isfinite(before.grad).all() and torch.isfinite(after.grad).all()
    assert (after.grad[:, 0] > 0).all()


@pytest.mark.parametrize("thickness", [0.005, 0.0005])
def test_water_that_falls_at_10_m_s_on_a_thin_plate_stays_above(thickness):
    scene = Scene.from_yaml(
        "container: {size: [1.2, 1.2, 2.5]}\nframes: 60\n"
        f"surface: {{box: {{size: [1.2, 1.2, {thickness}]}}, at: [0, 0, 0.5]}}\n"
        "fluid:\n  - block: {min: [-0.3, -0.3, 0.6], max: [0.3, 0.3, 0.75], velocity: [0, 0, -10]}\n"
        "  - block: {min: [-0.3, -0.3, 1.6], max: [0.3, 0.3, 1.75], velocity: [0, 0, -10]}\n",
        "test",
    )
    *_, last = sf.Simulation(scene, device="cpu").run()
    assert (last.positions[:, 2] > 0.5).all()


@pytest.mark.parametrize("speed", [30, 50])
def test_water_thrown_about_in_a_shell_of_5_mm_stays_in_it(speed):
    scene = Scene.from_yaml(
        "container: {size: [1, 1, 1]}\nframes: 30\n"
        "surface: {difference: [{sphere: {radius: 0.2}}, {sphere: {radius: 0.195}}], at: [0, 0, 0.5]}\n"
        f"fluid: [{{block: {{min: [-0.06, -0.06, 0.44], max: [0.06, 0.06, 0.56], velocity: [{speed}, 0, 0]}}}}]\n",
        "test",
    )
    *_, last = sf.Simulation(scene, device="cpu").run()
    assert np.linalg.norm(last.positions - [0, 0, 0.5], axis=1).max() < 0.2
