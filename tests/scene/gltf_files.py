"""Small animated glTF files, written by trimesh and completed here."""

import json
import struct

import numpy as np
import trimesh

FLOAT, VECTORS = 5126, {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}


def write_animated(path, nodes, channels, meshes=None):
    """Write a GLB file.

    Args:
        path: of the file.
        nodes: as in glTF; the first ones that have no parent are in the scene.
        channels: (animation, node number, property, interpolation, times, values) of each.
        meshes: trimesh objects by the number of their node.
    """
    document, binary = {"asset": {"version": "2.0"}}, bytearray()
    if meshes:
        scene = trimesh.Scene()
        for number, mesh in meshes.items():
            scene.add_geometry(mesh, node_name=str(number), geom_name=str(number))
        glb = scene.export(file_type="glb")
        length = struct.unpack_from("<I", glb, 12)[0]
        document, binary = json.loads(glb[20 : 20 + length]), bytearray(glb[28 + length :])
    children = {child for node in nodes for child in node.get("children", [])}
    by_number = {node["name"]: node["mesh"] for node in document.get("nodes", []) if "mesh" in node}
    document["nodes"] = [
        node | ({"mesh": by_number[str(number)]} if str(number) in by_number else {})
        for number, node in enumerate(nodes)
    ]
    document["scenes"] = [{"nodes": [number for number in range(len(nodes)) if number not in children]}]
    views, accessors = document.setdefault("bufferViews", []), document.setdefault("accessors", [])

    def accessor(values, kind):
        content = np.asarray(values, "<f4").tobytes()
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(content)})
        binary.extend(content)
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": FLOAT, "type": kind, "count": len(np.atleast_1d(values))}
        )
        return len(accessors) - 1

    animations = {}
    for name, node, prop, interpolation, times, values in channels:
        entry = animations.setdefault(name, {"name": name, "channels": [], "samplers": []})
        entry["channels"].append({"sampler": len(entry["samplers"]), "target": {"node": node, "path": prop}})
        sampler = {"input": accessor(times, "SCALAR"), "output": accessor(values, VECTORS[prop])}
        entry["samplers"].append(sampler | {"interpolation": interpolation})
    if animations:
        document["animations"] = list(animations.values())
    document["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
    return path
