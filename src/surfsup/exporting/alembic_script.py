"""Writes an Alembic file from a USD file, by Blender as a Python package.

    python alembic_script.py water.usdc water.abc 24

It runs in a process of its own: Blender's libraries include another USD.
"""

from __future__ import annotations

import sys

import bpy


def as_vertices(cloud: bpy.types.Object) -> bpy.types.Object:
    """A new object with the points of a cloud as vertices, because Blender writes no clouds to Alembic."""
    tree = bpy.data.node_groups.new("AsVertices", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source = tree.nodes.new("GeometryNodeObjectInfo")
    source.inputs["Object"].default_value = cloud
    vertices, out = tree.nodes.new("GeometryNodePointsToVertices"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(source.outputs["Geometry"], vertices.inputs[0])
    tree.links.new(vertices.outputs[0], out.inputs[0])
    made = bpy.data.objects.new("Particles", bpy.data.meshes.new("Particles"))
    made.modifiers.new("AsVertices", "NODES").node_group = tree
    bpy.context.scene.collection.objects.link(made)
    return made


def main(source: str, target: str, fps: float) -> None:
    """Write the frames of ``source`` to ``target``."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, objects = bpy.context.scene, bpy.data.objects
    scene.render.fps = max(1, round(fps))  # an integer; its base is a number
    scene.render.fps_base = scene.render.fps / fps
    bpy.ops.wm.usd_import(filepath=source, set_frame_range=True)
    written = [each for each in objects if each.type == "MESH"]
    if "Particles" in objects:
        objects["Particles"].name = "Cloud"
        written.append(as_vertices(objects["Cloud"]))
    bpy.ops.object.select_all(action="DESELECT")
    for shape in written:
        shape.select_set(True)
    bpy.ops.wm.alembic_export(filepath=target, selected=True, flatten=True, uvs=False, as_background_job=False)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
