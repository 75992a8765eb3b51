"""An assembly, a folder of meshes or a glTF scene, as a scene file in which every part is a solid of its own."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
import yaml

from surfsup.errors import InputError
from surfsup.scene.container import Container
from surfsup.scene.fluid import PARTICLE_RADIUS
from surfsup.scene.from_surface import block_above, check_fits
from surfsup.scene.gltf_motion import GltfMotion, animated_nodes
from surfsup.sdf import load_mesh
from surfsup.sdf.mesh.cleaning import clean
from surfsup.sdf.mesh.mesh_file import FORMATS
from surfsup.sdf.mesh.readers.gltf import read_parts
from surfsup.sdf.mesh.readers.raw_mesh import UnreadableMeshError

GLTF = (".glb", ".gltf")


def write_assembly(source: Path, out: Path, fit: float | None, up: Literal["y", "z"] | None = None) -> list[str]:
    """Write the scene file ``out`` of an assembly, and its parts into a folder beside it.

    Each part becomes a mesh about the middle of its own box, placed by ``at``, so that a motion turns it there. A node
    that the glTF file animates keeps its own frame and its motion. A block of water is above the whole.

    Args:
        source: a folder of mesh files, or a GLB or glTF file, whose nodes are the parts.
        out: the scene file.
        fit: largest extent of the whole in meters; None keeps the coordinates of the files, in meters.
        up: upward axis of the files; None for that of the format.

    Returns:
        The names of the parts.

    Raises:
        InputError: a file is unusable, there is none, the whole does not fit, or nothing can be written.
    """
    motions: dict[str, GltfMotion] = {}
    if source.is_dir():
        parts = folder_parts(source, up)
    else:
        parts, motions = gltf_parts(source, up)
    if not parts:
        raise InputError(
            f"{source}: has no parts; a folder needs mesh files ({', '.join(FORMATS)}), a glTF file meshes"
        )
    boxes = np.array([part.bounds for part in parts.values()])
    lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    scale, shift = 1.0, np.zeros(3)
    if fit is not None:
        scale = fit / float((upper - lower).max())
        shift = -np.array([*(lower + upper)[:2] / 2, lower[2]])
    lower, upper = scale * (lower + shift), scale * (upper + shift)
    container = Container()
    check_fits(source, lower, upper, container, PARTICLE_RADIUS, fitted=fit is not None)
    block = block_above(lower, upper, container, PARTICLE_RADIUS)
    files = out.with_name(f"{out.stem}-files")
    surfaces: dict[str, Any] = {}
    try:
        files.mkdir(parents=True, exist_ok=True)
        for name, part in parts.items():
            mesh = {"file": f"{files.name}/{name}.ply"}
            if name in motions:
                own = motions[name].to_own(part.vertices)
                surfaces[name] = {"mesh": mesh, "motion": motion_entry(source, out, motions[name].node, scale, shift)}
            else:
                middle = part.bounds.mean(axis=0)
                own, at = part.vertices - middle, np.round(scale * (middle + shift), 9) + 0.0
                surfaces[name] = {"mesh": mesh, "at": at.tolist()}
            trimesh.Trimesh(scale * own, part.faces, process=False).export(files / f"{name}.ply")
        water = {"min": list(map(float, block.min)), "max": list(map(float, block.max))}
        scene = {"surfaces": surfaces, "fluid": [{"block": water}]}
        text = yaml.safe_dump(scene, sort_keys=False, default_flow_style=None)
        partial = out.with_name(f".{out.name}.partial")
        partial.write_text(f"# The parts of {source.name}, each a solid of its own.\n{text}", encoding="utf-8")
        partial.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from None
    return list(surfaces)


def folder_parts(folder: Path, up: Literal["y", "z"] | None) -> dict[str, trimesh.Trimesh]:
    """The meshes of a folder by the names of their files."""
    files = sorted(
        path for path in folder.iterdir() if path.suffix.lower().removeprefix(".") in FORMATS and path.is_file()
    )
    return named([(path.stem, load_mesh(path, up)) for path in files])


def gltf_parts(path: Path, up: Literal["y", "z"] | None) -> tuple[dict[str, trimesh.Trimesh], dict[str, GltfMotion]]:
    """The meshes of the nodes of a glTF file by name, with z up, and the motions of those that it animates."""
    try:
        content = path.read_bytes()
        raw, animated = read_parts(content), animated_nodes(content)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    except UnreadableMeshError as error:
        raise InputError(f"{path}: {error}") from None
    parts = []
    for name, part in raw:
        if len(part.faces):
            mesh = clean(part.vertices, part.faces, path)
            if up != "z":
                mesh.vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
            parts.append((name, mesh))
    if animated and up == "z":
        raise InputError(f"{path}: is animated, and y is up in its animation; omit --up")
    meshes = named(parts)
    motions = {own: GltfMotion(path, name) for own, (name, _) in zip(meshes, parts, strict=True) if name in animated}
    return meshes, motions


def motion_entry(source: Path, out: Path, node: str, scale: float, shift: np.ndarray) -> dict[str, Any]:
    """The motion of a node as the scene file ``out`` has it, where the whole is moved by ``shift``, then scaled."""
    entry: dict[str, Any] = {"gltf": os.path.relpath(source, out.parent), "node": node}
    if scale != 1 or shift.any():
        entry |= {"scale": float(scale), "offset": (np.round(scale * shift, 9) + 0.0).tolist()}
    return entry


def named(parts: list[tuple[str, trimesh.Trimesh]]) -> dict[str, trimesh.Trimesh]:
    """The parts under names that differ and suit files and scenes."""
    found: dict[str, trimesh.Trimesh] = {}
    for name, mesh in parts:
        plain = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "part"
        number = 1
        while (unique := plain if number == 1 else f"{plain}-{number}") in found or unique == "container":
            number += 1
        found[unique] = mesh
    return found
