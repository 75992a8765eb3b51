"""Solids that move as one GLB file: a node with keyframes for each, and its mesh once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh

from surfsup.exporting.solids import SolidMeshes
from surfsup.exporting.up_axis import pose_with_up_axis, turned
from surfsup.scene.pose import Pose

FLOAT = 5126


def animated(solids: SolidMeshes, times: Sequence[float]) -> bytes:
    """The content of the file: y is up, as glTF requires; keys are joined by straight lines.

    Args:
        solids: of a trajectory.
        times: (K,) of the keys, seconds; the first one is 0 in the file.
    """
    scene = trimesh.Scene()
    if solids.still is not None:
        still = trimesh.Trimesh(turned(solids.still.vertices), solids.still.triangles, process=False)
        scene.add_geometry(still, node_name="still", geom_name="still")
    for solid in solids.moving:
        vertices = turned(np.asarray(solid.mesh.vertices))
        scene.add_geometry(trimesh.Trimesh(vertices, solid.mesh.faces, process=False), solid.name, solid.name)
    poses = {solid.name: [solids.pose_of(solid, time) for time in times] for solid in solids.moving}
    seconds = np.array(times) - times[0]

    def add_animation(buffers: Any, tree: dict[str, Any]) -> None:
        """Append keys to what trimesh is about to write."""

        def accessor(name: str, values: np.ndarray, kind: str, **bounds: list[float]) -> int:
            content = values.astype("<f4")
            tree["accessors"][f"{kind} {name}"] = {
                "bufferView": len(buffers), "componentType": FLOAT, "count": len(content), "type": kind, **bounds,
            }  # fmt: skip
            buffers[f"{kind} {name}"] = content.tobytes()
            return len(tree["accessors"]) - 1

        clock = accessor("times", seconds, "SCALAR", min=[0.0], max=[float(np.float32(seconds[-1]))])
        channels: list[dict[str, Any]] = []
        samplers: list[dict[str, Any]] = []
        for number, node in enumerate(tree["nodes"]):
            if node.get("name") not in poses:
                continue
            positions, rotations = y_up(poses[node["name"]])
            node.pop("matrix", None)  # an animated node must not have one
            for path, values, kind in (("translation", positions, "VEC3"), ("rotation", rotations, "VEC4")):
                node[path] = values[0].tolist()
                channels.append({"sampler": len(samplers), "target": {"node": number, "path": path}})
                samplers.append({"input": clock, "output": accessor(node["name"], values, kind)})
        tree["animations"] = [{"name": "motion", "channels": channels, "samplers": samplers}]

    return bytes(trimesh.exchange.gltf.export_glb(scene, include_normals=True, buffer_postprocessor=add_animation))


def y_up(poses: Sequence[Pose]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (K, 3) and quaternions (K, 4) x, y, z, w of poses, with y up; neighbors take the shorter way."""
    turned_poses = [pose_with_up_axis(pose, "y") for pose in poses]
    positions = np.array([pose.position for pose in turned_poses])
    rotations = np.array([pose.rotation for pose in turned_poses])
    for number in range(1, len(rotations)):
        if rotations[number] @ rotations[number - 1] < 0:
            rotations[number] *= -1
    return positions, np.roll(rotations, -1, axis=1)
