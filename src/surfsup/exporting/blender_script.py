"""Opens the water of water.usdc, which lies beside this file, in Blender.

    blender --python open_in_blender.py                   # in a window
    blender --background --python open_in_blender.py      # writes water.blend; so does Python with the package bpy

Written by surfsup. Blender reads every frame from water.usdc when it shows or renders it, with velocities for motion
blur, so keep both files together.
"""

from __future__ import annotations

from pathlib import Path

import bpy

FOLDER = Path(__file__).resolve().parent
FPS = 24.0  # frames per second of water.usdc
TINTS = {"Surface": (0.6, 0.85, 1.0)}  # of the liquids by their surfaces


def shader(owner: bpy.types.Material | bpy.types.World, kind: str) -> bpy.types.ShaderNode:
    """The shader of a new material or world."""
    if owner.node_tree is None:  # before Blender 5
        owner.use_nodes = True
    return next(node for node in owner.node_tree.nodes if node.type == kind)


def material(name: str, color: tuple[float, float, float], **inputs: float) -> bpy.types.Material:
    """A new material with the given inputs of the principled shader."""
    made = bpy.data.materials.new(name)
    node = shader(made, "BSDF_PRINCIPLED")
    node.inputs["Base Color"].default_value = (*color, 1.0)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return made


def main() -> None:
    """Import the water, give it materials, a lamp and a camera, and save it if there is no window."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, objects = bpy.context.scene, bpy.data.objects
    scene.render.fps = max(1, round(FPS))  # an integer; its base is a number
    scene.render.fps_base = scene.render.fps / FPS
    bpy.ops.wm.usd_import(filepath=str(FOLDER / "water.usdc"), set_frame_range=True)
    drops = material("Drops", (0.1, 0.35, 0.7), Roughness=0.2)
    solid = material("Solid", (0.55, 0.5, 0.45), Roughness=0.6)
    for shape in [each for each in objects if each.data is not None]:
        chosen = drops if shape.name == "Particles" else solid
        if shape.name in TINTS:
            chosen = material("Water", TINTS[shape.name], Roughness=0.02, IOR=1.333, Transmission_Weight=1.0)
        shape.data.materials.clear()
        shape.data.materials.append(chosen)
    if "Particles" in objects and any(name in objects for name in TINTS):
        objects["Particles"].hide_render = True
        objects["Particles"].hide_set(True)

    bpy.ops.mesh.primitive_plane_add(size=20.0)  # the floor
    bpy.context.object.data.materials.append(material("Floor", (0.25, 0.25, 0.27), Roughness=0.9))
    lamp = objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    lamp.data.energy, lamp.data.angle, lamp.rotation_euler = 3.0, 0.1, (0.6, 0.2, 0.5)
    camera = objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.data.lens = (1.5, -2.1, 1.5), (1.12, 0.0, 0.62), 60.0
    for made in (lamp, camera):
        scene.collection.objects.link(made)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    sky = shader(scene.world, "BACKGROUND").inputs
    sky["Color"].default_value, sky["Strength"].default_value = (0.7, 0.85, 1.0, 1.0), 0.5
    scene.render.engine = "CYCLES"
    scene.render.use_motion_blur = True
    if bpy.app.background:
        bpy.context.preferences.filepaths.save_version = 0  # no backup of the first save
        bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "water.blend"))
        bpy.ops.file.make_paths_relative()
        bpy.ops.wm.save_mainfile()


if __name__ == "__main__":
    main()
