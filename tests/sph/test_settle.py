import warnings

import numpy as np
import pytest
import torch

from surfsup import Block, InputError, Scene, Simulation
from surfsup.native.dispatch import is_built
from surfsup.scene import SPACING, Fill
from surfsup.scene.pose import Pose
from surfsup.sph import settle
from surfsup.sph.collision import CLEARANCE
from surfsup.sph.settle import NotSettledWarning

CUP = {"bowl": {"capture_radius": 0.14}, "at": [0, 0, 0.2]}


def scene_of(*fluid: object, **values: object) -> Scene:
    surface = Scene.from_yaml(f"surface: {CUP}\nfluid: [{{fill: {{below: 1}}}}]", "cup").surface
    return Scene(surface=surface, fluid=fluid, **values)


def test_settled_water_begins_at_rest_and_stays_so():
    scene = scene_of(Fill(below=0.19, settle=True))
    surface = scene.build_surface()
    start = Simulation(scene, device="cpu").particles
    assert len(start.positions) == len(scene.initial_particles(surface).positions)
    assert not start.velocities.any()
    assert surface.distance(torch.from_numpy(start.positions)).min() > CLEARANCE - 1e-4
    unsettled = Simulation(scene_of(Fill(below=0.19)), device="cpu")
    energies = [
        [0.5 * np.square(frame.velocities).sum(axis=1).mean() for frame in one.run(0.25)]
        for one in (Simulation(scene, device="cpu"), unsettled)
    ]
    assert max(energies[0]) < 2 * settle.MAX_ENERGY < max(energies[1])


@pytest.mark.skipif(not is_built(), reason="liquids run in the C++ code")
@pytest.mark.parametrize("liquid", ["water", "honey"])
def test_any_liquid_settles_as_soon_as_the_solvers_own_water(liquid):
    cups = [scene_of(Fill(below=0.19, settle=True), **values) for values in ({}, {"liquid": liquid})]
    with warnings.catch_warnings():
        warnings.simplefilter("error", NotSettledWarning)
        own, other = (Simulation(cup, device="cpu").particles for cup in cups)
    np.testing.assert_array_equal(own.positions, other.positions)


def test_other_water_waits_until_the_cup_is_at_rest():
    drop = Block((-0.06, -0.06, 0.4), (0.06, 0.06, 0.52), velocity=(0, 0, -1))
    scene = scene_of(Fill(below=0.19, settle=True, velocity=(0.1, 0, 0)), drop)
    start = Simulation(scene, device="cpu").particles
    np.testing.assert_array_equal(start.block_positions[1], drop.positions())
    assert start.block_velocities == [(0.1, 0.0, 0.0), (0.0, 0.0, -1.0)]


def test_small_water_settles_like_large_water():
    text = (
        "container: {{size: [{0}, {0}, {0}]}}\nparticle_radius: {1}\n"
        "surface: {{bowl: {{capture_radius: {2}, wall: {3}}}, at: [0, 0, {4}]}}\n"
        "fluid: [{{fill: {{below: {5}, settle: true, velocity: [0.1, 0, 0]}}}}]"
    )
    scenes = [
        Scene.from_yaml(text.format(*(s * length for length in (1.0, 0.015, 0.14, 0.04, 0.2, 0.19))), "cup")
        for s in (1.0, 0.25)
    ]
    large, small = (Simulation(scene, device="cpu").particles for scene in scenes)
    assert small.block_velocities == [(0.1, 0.0, 0.0)]
    assert small.positions[:, 2].mean() == pytest.approx(large.positions[:, 2].mean() / 4, abs=1e-5)


def test_water_that_overlaps_settled_water_is_left_out():
    scene = scene_of(Fill(below=0.19, settle=True), Block((-0.06, -0.06, 0.13), (0.06, 0.06, 0.4)))
    start = Simulation(scene, device="cpu").particles
    assert torch.pdist(torch.from_numpy(start.positions)).min() > 0.5 * SPACING
    assert start.excluded > 0


def test_water_that_does_not_come_to_rest_gives_one_warning(monkeypatch):
    monkeypatch.setattr(settle, "MAX_FRAMES", 20)
    scene = scene_of(Fill(below=0.19, settle=True))
    with pytest.warns(NotSettledWarning, match="water that settles still moves at") as warned:
        Simulation(scene, device="cpu")
    assert len(warned) == 1 and "\n" not in str(warned[0].message)


def test_a_scene_continues_a_trajectory(tmp_path):
    scene = scene_of(Block((-0.06, -0.06, 0.3), (0.06, 0.06, 0.42)), frames=31)
    frames = list(Simulation(scene, device="cpu").run())
    Simulation(scene.with_frames(21), device="cpu").record(tmp_path / "first.h5")
    second = Simulation(scene.with_changes(restart=tmp_path / "first.h5", frames=11), device="cpu")
    assert second.time == pytest.approx(0.1)
    again = list(second.run())
    np.testing.assert_allclose([frame.time for frame in again], 0.1 + 0.005 * np.arange(11))
    np.testing.assert_array_equal(again[0].positions, frames[20].positions)
    # A file rounds velocities to 2^-16 m/s.
    np.testing.assert_allclose(again[-1].positions, frames[-1].positions, atol=1e-3)


def test_a_restart_from_another_radius_is_refused(tmp_path):
    scene = scene_of(Block((-0.06, -0.06, 0.3), (0.06, 0.06, 0.42)), frames=2)
    Simulation(scene, device="cpu").record(tmp_path / "first.h5")
    with pytest.raises(InputError, match=r"has particles of radius 0\.015 m, but the scene of 0\.01 m"):
        Simulation(scene.with_changes(restart=tmp_path / "first.h5", particle_radius=0.01), device="cpu")


MOVED = (
    "container: {size: [0.4, 0.4, 0.4], motion: {keyframes: [{time: 0, position: [1, 0, 0],"
    " rotation: {axis: [0, 1, 0], degrees: 20}}, {time: 1, position: [1.5, 0, 0]}]}}\n"
    "frames: 41\nfluid: [{fill: {surface: {box: {size: [0.2, 0.2, 0.15]}, at: [1.05, 0, 0.14]}, settle: %s}}]"
)


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_water_settles_in_a_container_that_begins_tilted(monkeypatch):
    monkeypatch.setattr(settle, "MAX_FRAMES", 150)
    scene = Scene.from_yaml(MOVED % "true", "test")
    pose = scene_pose(scene, 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotSettledWarning)
        start = Simulation(scene, device="cpu").particles
    own = pose.to_own(start.positions)
    assert (np.abs(own[:, :2]) < 0.2).all() and (own[:, 2] > 0).all() and own[:, 2].min() < 0.03
    assert own[:, 0].mean() > 0.05  # the lower side


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_a_scene_continues_in_a_container_that_moves(tmp_path):
    scene = Scene.from_yaml(MOVED % "false", "test")
    Simulation(scene).record(tmp_path / "first.h5")
    second = Simulation(scene.with_changes(restart=tmp_path / "first.h5"))
    np.testing.assert_allclose(second.frame.poses["container"].array, scene_pose(scene, 0.2).array)
    own = second.step().poses["container"].to_own(second.frame.positions)
    assert (np.abs(own[:, :2]) < 0.2).all() and (own[:, 2] > 0).all()


def scene_pose(scene: Scene, time: float) -> Pose:
    return scene.container.motion.pose_function(Pose.of())(time)
