import json
import subprocess
import sys

import numpy as np
import pytest

from surfsup import Block, Scene
from surfsup.splishsplash.scene_export import export_scene
from surfsup.splishsplash.scene_import import import_scene
from tests.datasets.conftest import needs_solver

TEXT = """
container: {size: [0.8, 0.6, 1]}
surface: {sphere: {radius: 0.1}, at: [0.1, 0, 0.15]}
particle_radius: 0.02
frames: 3
fluid:
  - block: {min: [-0.1, -0.1, 0.4], max: [0.1, 0.1, 0.6]}
  - block: {min: [-0.1, -0.1, 0.7], max: [0.1, 0.1, 0.8], velocity: [0, 0, -1]}
"""


@needs_solver
def test_the_solver_runs_the_exported_scene_with_the_same_particles(tmp_path):
    scene, file = Scene.from_yaml(TEXT, "a"), tmp_path / "scene.json"
    exported = export_scene(scene, file)
    assert exported.missing == []
    assert list(tmp_path.iterdir()) == []
    exported.write()
    command = [sys.executable, "-m", "surfsup.splishsplash.child_process", str(file), "2", "5"]
    output = subprocess.run(command, capture_output=True, check=True).stdout
    (count,) = np.frombuffer(output[:8], np.int64)
    first = np.frombuffer(output, np.float32, 6 * count, 8).reshape(2, count, 3)
    start = scene.initial_particles(scene.build_surface())
    assert count == len(start.positions)
    # Its models come one after the other, ours block by block.
    order, expected = np.lexsort(first[0].T), np.lexsort(start.positions.T)
    np.testing.assert_allclose(first[0][order], start.positions[expected], atol=1e-6)
    np.testing.assert_allclose(first[1][order], start.velocities[expected], atol=1e-6)


def test_there_and_back_is_the_same_scene(tmp_path):
    scene, file = Scene.from_yaml(TEXT, "a"), tmp_path / "scene.json"
    export_scene(scene, file).write()
    result = import_scene(file, tmp_path / "back.yaml")
    result.write()
    back = Scene.from_yaml(result.text, "back", tmp_path)
    assert back.container.size == pytest.approx(scene.container.size)
    assert (back.gravity, back.particle_radius) == (scene.gravity, scene.particle_radius)
    assert back.frames == scene.frames
    (solid,) = back.surfaces.values()
    np.testing.assert_allclose(solid.surface(tmp_path).bounds().numpy(), [[0, -0.1, 0.05], [0.2, 0.1, 0.25]], atol=2e-3)
    ours, theirs = (one.initial_particles(None) for one in (scene, back))
    np.testing.assert_allclose(np.unique(theirs.positions, axis=0), np.unique(ours.positions, axis=0), atol=1e-6)


def test_a_liquid_goes_there_and_back(tmp_path):
    liquid = "{viscosity: 0.1, surface_tension: 5, adhesion: 2, friction: 0.5, density: 900}"
    text = f"particle_radius: 0.02\nliquid: {liquid}\n" + TEXT.replace("particle_radius: 0.02\n", "")
    scene = Scene.from_yaml(text, "a")
    exported = export_scene(scene, tmp_path / "scene.json")
    assert exported.missing == []
    exported.write()
    back = Scene.from_yaml(import_scene(tmp_path / "scene.json", tmp_path / "b.yaml").text, "b", tmp_path)
    found, expected = (each.liquid.model_dump(exclude_none=True) for each in (back, scene))
    assert found == pytest.approx(expected, rel=1e-5)


def test_motions_are_named_as_missing(tmp_path):
    moving = "container: {motion: {spin: {axis: [0, 0, 1], turns: 1}}}\n" + TEXT.split("frames: 3\n")[1]
    assert "motions" in export_scene(Scene.from_yaml(moving, "a"), tmp_path / "a.json").missing[0]


def test_an_open_container_has_no_walls(tmp_path):
    from surfsup import Container

    scene = Scene(container=Container(open=True), fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))])
    assert json.loads(export_scene(scene, tmp_path / "a.json").text)["RigidBodies"] == []
