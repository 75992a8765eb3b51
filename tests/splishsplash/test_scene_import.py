"""Scenes written after the public ones of SPlisHSPlasH: walls as an inverted box, upward axis y, radians."""

import json
import math

import numpy as np
import pytest
import trimesh

from surfsup import InputError, Liquid, Scene
from surfsup.scene import quaternion
from surfsup.scene.solids import build_solids
from surfsup.sph.liquid import LiquidForces
from surfsup.splishsplash.joints import MOTOR
from surfsup.splishsplash.scene_import import import_scene

WALLS = {
    "geometryFile": "box.obj", "translation": [0, 2, 0], "scale": [6, 4, 3], "rotationAxis": [1, 0, 0],
    "rotationAngle": 0, "isDynamic": False, "isWall": True, "mapInvert": True, "mapResolution": [30, 30, 20],
}  # fmt: skip
BLOCK = {"denseMode": 0, "start": [-1, 0, -0.5], "end": [0, 1, 0.5], "translation": [0.1, 0.2, 0.3], "scale": [1, 1, 1]}
BODY = {
    "id": 1, "geometryFile": "box.obj", "translation": [0, 1, 0.5], "scale": [0.4, 0.3, 0.2], "isDynamic": True,
    "density": 200, "velocity": [0, 0, 1],
}  # fmt: skip
HINGE = {"bodyID1": 1, "bodyID2": 0, "position": [0.1, 1, 0.5], "axis": [0, 1, 0]}
SCENE = {
    "Configuration": {"particleRadius": 0.025, "gravitation": [0, -9.81, 0], "simulationMethod": 4, "stopAt": 2},
    "Materials": [{"id": "Fluid", "density0": 1000, "viscosityMethod": 1, "Standard viscosity": {"viscosity": 0.01}}],
    "RigidBodies": [WALLS],
    "FluidBlocks": [BLOCK],
}


@pytest.fixture
def converted(tmp_path):
    """Convert a scene that differs from the usual one; returns our scene and what is missing."""
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.obj")
    wedge = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    wedge.export(tmp_path / "wedge.obj")

    def convert(**changes):
        file, out = tmp_path / "scene.json", tmp_path / "scene.yaml"
        file.write_text(json.dumps({**SCENE, **changes}))
        result = import_scene(file, out)
        assert not out.exists() and not (tmp_path / "scene-files").exists()
        result.write()
        return Scene.from_yaml(result.text, "converted", tmp_path), result.missing

    return convert


def test_walls_become_the_container_and_y_becomes_z(converted):
    scene, missing = converted()
    assert missing == []
    assert scene.container.size == (6, 3, 4)
    assert scene.gravity == (0, 0, -9.81)
    assert (scene.particle_radius, scene.duration, scene.density) == (0.025, 2, 1000)
    block = scene.fluid[0].block
    np.testing.assert_allclose(block.min, [-0.9, -0.8, 0.2])  # (x, y, z) is (x, -z, y)
    np.testing.assert_allclose(block.max, [0.1, 0.2, 1.2])


def test_walls_beside_the_origin_move_everything(converted):
    scene, _ = converted(RigidBodies=[{**WALLS, "translation": [1, 5, 2]}])
    np.testing.assert_allclose(scene.fluid[0].block.min, [-1.9, 1.2, 0.2 - 3], atol=1e-9)


def test_a_scene_whose_gravity_is_along_z_is_not_turned(converted):
    walls = {**WALLS, "translation": [0, 0, 2], "scale": [6, 3, 4]}
    scene, _ = converted(RigidBodies=[walls], Configuration={**SCENE["Configuration"], "gravitation": [0, 0, -9.81]})
    assert scene.container.size == (6, 3, 4)
    np.testing.assert_allclose(scene.fluid[0].block.min, [-0.9, 0.2, -0.2])


def test_without_walls_the_container_is_open(converted):
    scene, _ = converted(RigidBodies=[])
    assert scene.container.open


def test_boxes_and_meshes_stand_where_they_stood(converted):
    turned = {"rotationAxis": [0, 1, 0], "rotationAngle": math.pi / 2}
    box = {"geometryFile": "box.obj", "translation": [1, 0.5, 0.25], "scale": [0.2, 1, 0.6], "isWall": False, **turned}
    mesh = {"geometryFile": "wedge.obj", "translation": [-2, 0, 0], "scale": [0.5, 0.5, 0.5], "isWall": False, **turned}
    stretched = {**mesh, "scale": [0.5, 0.25, 1]}
    scene, missing = converted(RigidBodies=[WALLS, box, mesh, stretched])
    assert missing == []
    assert list(scene.surfaces) == ["box-1", "wedge-2", "wedge-3"]
    of_box = scene.surfaces["box-1"].surface(scene.base_folder).bounds().numpy()
    # A quarter turn about the upward axis exchanges the sides 0.2 and 0.6.
    np.testing.assert_allclose(of_box, [[0.7, -0.35, 0], [1.3, -0.15, 1]], atol=1e-6)
    for name, scale in (("wedge-2", [0.5, 0.5, 0.5]), ("wedge-3", [0.5, 0.25, 1])):
        # Turned about y by 90 degrees x is -z and z is x; then y is up.
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]]) * scale
        there = np.stack([vertices[:, 2] - 2, vertices[:, 1], -vertices[:, 0]], axis=1)
        ours = np.stack([there[:, 0], -there[:, 2], there[:, 1]], axis=1)
        found = scene.surfaces[name].surface(scene.base_folder).bounds().numpy()
        np.testing.assert_allclose(found, [ours.min(axis=0), ours.max(axis=0)], atol=1e-6, err_msg=name)


def test_particles_are_placed(converted, tmp_path):
    np.save(tmp_path / "water.npy", np.array([[0.1, 0.2, 0.3], [0.2, 0.2, 0.3]], np.float32))
    model = {
        "particleFile": "water.npy", "translation": [1, 2, 0], "scale": [2, 2, 2], "initialVelocity": [0, -1, 3],
    }  # fmt: skip
    scene, _ = converted(FluidBlocks=[], FluidModels=[model])
    particles = scene.fluid[0].particles.read(scene.base_folder)
    np.testing.assert_allclose(particles.positions, [[1.2, -0.6, 2.4], [1.4, -0.6, 2.4]], atol=1e-6)
    np.testing.assert_allclose(particles.velocities, [[0, -3, -1]] * 2)


def test_a_body_that_moves_freely_floats(converted):
    scene, missing = converted(RigidBodies=[WALLS, BODY])
    assert missing == []
    body = scene.surfaces["box-1"]
    assert (body.rigid_body.density, body.rigid_body.velocity) == (200, (0, -1, 0))
    np.testing.assert_allclose(body.at, [0, -0.5, 1])


def test_a_body_on_a_hinge_turns_about_an_axle(converted):
    scene, missing = converted(RigidBodies=[WALLS, BODY], HingeJoints=[HINGE])
    assert missing == []
    body = scene.surfaces["box-1"].rigid_body
    assert (body.axle.axis, body.axle.point, body.velocity) == ((0, 0, 1), (0.1, -0.5, 1), (0, 0, 0))


@pytest.mark.parametrize(("ends", "rate"), [((1, 0), 6), ((0, 1), -6)])
def test_a_motor_turns_its_body_by_the_target_as_the_solver_does(converted, ends, rate):
    """With the target -6 the body of MotorScene, its first one, turns at +6 about the axis (run by SPlisHSPlasH)."""
    joint = {**HINGE, "bodyID1": ends[0], "bodyID2": ends[1], "target": -6}
    scene, missing = converted(RigidBodies=[WALLS, BODY], TargetVelocityMotorHingeJoints=[joint])
    assert missing == []
    surface = scene.surfaces["box-1"]
    assert surface.rigid_body is None
    spin = surface.motion.spin
    assert (spin.axis, spin.point, spin.rate) == ((0, 0, 1), (0.1, -0.5, 1), rate)


@pytest.mark.parametrize(("repeats", "turn"), [(True, 1.25), (False, 2.5)])
def test_a_motor_with_a_sequence_of_targets_follows_it(converted, repeats, turn):
    joint = {**HINGE, "targetSequence": [0, -5, 1, 5, 2, -5], "repeatSequence": repeats}
    turned = {**BODY, "rotationAxis": [0, 1, 0], "rotationAngle": 0.3}
    scene, missing = converted(
        RigidBodies=[WALLS, turned],
        TargetVelocityMotorHingeJoints=[joint],
        Configuration={**SCENE["Configuration"], "stopAt": 3},
    )
    assert missing == []
    solid = build_solids(scene).moving[0]
    for time, angle in ((0, 0), (0.5, 1.25), (1, 0), (1.5, -1.25), (2, 0), (2.5, turn)):
        pose = solid.pose(time)
        assert quaternion.logarithm(pose.rotation)[2] == pytest.approx(0.3 + angle, abs=1e-3)
        arm = [-0.1 * math.cos(angle), -0.1 * math.sin(angle)]
        np.testing.assert_allclose(pose.position[:2], [0.1 + arm[0], -0.5 + arm[1]], atol=1e-3)


def test_materials_that_differ_become_liquids_that_do_not_mix(converted):
    materials = [
        {"id": "a", "density0": 1000, "Standard viscosity": {"viscosity": 0.01}},
        {"id": "b", "density0": 500, "Standard viscosity": {"viscosity": 0.027}},
        {"id": "of no fluid", "density0": 1, "Peer et al. 2015": {"viscosity": 1}},
    ]
    emitter = {"id": "b", "width": 8, "height": 3, "translation": [-1.2, 0.75, 0.5], "velocity": 2}
    scene, missing = converted(
        Materials=materials, FluidBlocks=[{**BLOCK, "id": "a"}, {**BLOCK, "id": "b"}], Emitters=[emitter]
    )
    assert missing == []
    light = Liquid(viscosity=0.02, friction=0, density=500)
    assert scene.mixture == (Liquid(density=1000), light)
    assert [entry.liquid for entry in scene.fluid] == [Liquid(density=1000), light] and scene.taps[0].liquid == light


def with_viscosity(method, **coefficients):
    return {"Materials": [{"id": "Fluid", "density0": 900, "viscosityMethod": 6, method: coefficients}]}


def test_the_viscosity_becomes_that_of_a_liquid(converted):
    scene, missing = converted(**with_viscosity("Weiler et al. 2018", viscosity=5, viscosityBoundary=10))
    assert missing == []
    assert LiquidForces.of(scene.liquid).viscosity == pytest.approx(5)
    assert LiquidForces.of(scene.liquid).boundary_viscosity == pytest.approx(10)
    assert scene.density == scene.liquid.density == 900


@pytest.mark.parametrize("viscosity", [0.01, 0.01 * (0.025 / 0.015) ** 1.5])
def test_the_viscosity_of_water_needs_no_liquid(converted, viscosity):
    scene, missing = converted(**with_viscosity("Standard viscosity", viscosity=viscosity))
    assert missing == [] and scene.liquid is None and scene.density == 900


@pytest.mark.parametrize("density", [1000, 900])
def test_the_surface_tension_of_akinci_is_that_of_a_liquid(converted, density):
    coefficients = {"surfaceTension": 0.5, "surfaceTensionBoundary": 0.2}
    material = {"id": "Fluid", "density0": density, "surfaceTensionMethod": 2, "Akinci et al. 2013": coefficients}
    scene, missing = converted(Materials=[material])
    assert missing == [] and scene.liquid.viscosity is None
    ours = LiquidForces.of(scene.units.liquid_to_solver(scene.liquid))
    # Their force is that of a coefficient times the density, ours is in a liquid of 1,000 kg/m³.
    assert ours.surface_tension == pytest.approx(0.5 * density / 1000)
    assert ours.adhesion == pytest.approx(0.2 * density / 1000)


def test_emitters_become_taps(converted):
    emitter = {
        "width": 8, "height": 3, "translation": [-1.2, 0.75, 0.5], "velocity": 2, "rotationAxis": [0, 1, 0],
        "rotationAngle": math.pi / 2, "emitStartTime": 1, "emitEndTime": 2,
    }  # fmt: skip
    scene, missing = converted(Emitters=[emitter], FluidBlocks=[])
    assert missing == [] and not scene.fluid
    (tap,) = scene.taps
    assert tap.rectangle.size == (0.4, 0.15) and (tap.speed, tap.start, tap.until) == (2, 1, 2)
    np.testing.assert_allclose(tap.at, [-1.2, -0.5, 0.75])
    np.testing.assert_allclose(tap.direction, [0, 1, 0], atol=1e-9)  # their x, turned about y, is -z


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"Emitters": [{}], "Materials": [{"id": "Fluid", "emitterReuseParticles": True}]}, "emitters that take back"),
        (
            {"AnimationFields": [{"particleField": "velocity", "expression_x": "cos(2*t)"}]},
            "the animation field of velocity = (cos(2*t), 0, 0)",
        ),
        ({"Configuration": {**SCENE["Configuration"], "sim2D": True}}, "two dimensions"),
        ({"Configuration": {**SCENE["Configuration"], "scriptFile": "a.py"}}, "the script a.py"),
        ({"Materials": [{"surfaceTensionMethod": 5}]}, "surface tension of another method than Akinci et al. 2013"),
        ({"Materials": [{"Peer et al. 2015": {"viscosity": 0.05}}]}, "the viscosity of 0.05 (Peer et al. 2015)"),
        ({"RigidBodies": [WALLS, BODY], "BallJoints": [{"bodyID1": 1, "bodyID2": 0}]}, "1 BallJoints"),
        ({"RigidBodies": [WALLS, BODY], "BallJoints": [{"bodyID1": 1, "bodyID2": 0}]}, "1 hangs on a joint"),
        (
            {"RigidBodies": [WALLS, BODY, {**BODY, "id": 2}], "HingeJoints": [{**HINGE, "bodyID2": 2}]},
            "a hinge between bodies that both move",
        ),
        ({"RigidBodies": [WALLS, BODY], "HingeJoints": [HINGE, HINGE]}, "a body on several joints"),
    ],
)
def test_what_we_do_not_have_is_listed(converted, changes, message):
    _, missing = converted(**changes)
    assert any(message in phrase for phrase in missing), missing


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not JSON"),
        ("[]", "is no scene of SPlisHSPlasH"),
        ("{}", "is no scene of SPlisHSPlasH"),
        (json.dumps({**SCENE, "FluidBlocks": []}), "has no fluid"),
        (json.dumps({**SCENE, "FluidBlocks": [{}]}), "is no scene of SPlisHSPlasH"),
        (json.dumps({**SCENE, "RigidBodies": [{**WALLS, "geometryFile": "missing.obj"}]}), "missing.obj"),
        (json.dumps({**SCENE, "RigidBodies": [{**WALLS, "geometryFile": "wedge.obj"}]}), "are no box along the axes"),
        (json.dumps({**SCENE, "RigidBodies": [{**WALLS, "scale": [1, 2]}]}), "scale must be three numbers"),
        (json.dumps({**SCENE, "RigidBodies": [{**BODY, "density": "x"}]}), "is no scene of SPlisHSPlasH"),
        (json.dumps({**SCENE, "RigidBodies": [{**BODY, "velocity": [1, 2]}]}), "velocity must be three numbers"),
        (json.dumps({**SCENE, "RigidBodies": [{"geometryFile": "box.obj", "isDynamic": 1}]}), "has no density"),
        (json.dumps({**SCENE, "Emitters": [{"velocity": 0}]}), "velocity"),
        (json.dumps({**SCENE, "Emitters": [{"width": "wide"}]}), "is no scene of SPlisHSPlasH"),
        (json.dumps({**SCENE, "Emitters": [{"translation": [0, 0]}]}), "translation must be three numbers"),
        (json.dumps({**SCENE, "RigidBodies": 3}), "is no scene of SPlisHSPlasH"),
        (
            json.dumps({**SCENE, "RigidBodies": [WALLS, BODY], "HingeJoints": [{**HINGE, "axis": [0, 0]}]}),
            "a joint needs a position and an axis",
        ),
        (
            json.dumps({**SCENE, "RigidBodies": [WALLS, BODY], MOTOR: [{**HINGE, "targetSequence": [0, 1, 0, 2]}]}),
            "the times of a targetSequence must increase",
        ),
        (json.dumps({**SCENE, "Configuration": {"particleRadius": 5}}), "must be from 0.001 to 0.1 m"),
    ],
)
def test_another_file_is_refused_in_one_line(converted, tmp_path, content, message):
    converted()  # so that the meshes are there
    file = tmp_path / "bad.json"
    file.write_text(content)
    with pytest.raises(InputError, match=message) as error:
        import_scene(file, tmp_path / "out.yaml")
    assert "\n" not in str(error.value)
