"""GLB, the binary form of glTF 2.0, whose upward axis is y."""

from __future__ import annotations

import trimesh

from surfsup.exporting.animated_glb import animated
from surfsup.exporting.mesh_frame import MeshFrame

__all__ = ["animated", "mesh"]


def mesh(frame: MeshFrame) -> bytes:
    """Triangles with normals, and velocities as the attribute ``_VELOCITY``."""
    scene = trimesh.Scene(metadata={"time": frame.time})
    if len(frame.triangles):
        water = trimesh.Trimesh(frame.vertices, frame.triangles, vertex_normals=frame.normals, process=False)
        water.vertex_attributes["_VELOCITY"] = frame.velocities
        scene.add_geometry(water, node_name="water", geom_name="water")
    return bytes(trimesh.exchange.gltf.export_glb(scene, include_normals=True))
