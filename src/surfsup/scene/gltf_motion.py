"""The motion of a node in an animated glTF file, as poses with z up."""

from __future__ import annotations

import difflib
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from surfsup.errors import InputError, single_line
from surfsup.scene.gltf_track import WIDTHS, Track, read_track
from surfsup.scene.pose import Pose, Vector
from surfsup.sdf.mesh.readers.gltf import chunks, own_matrix
from surfsup.sdf.mesh.readers.gltf_accessors import Accessors
from surfsup.sdf.mesh.readers.raw_mesh import UnreadableMeshError

TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # y is up in glTF, as our readers turn it
TOLERANCE = 1e-3  # of a scale that changes, and of axes that are not perpendicular
NAMED = 6  # nodes that a message lists

Tracks = dict[int, dict[str, Track]]  # by node and property


class GltfMotion:
    """The pose of a node over time: that of its own frame, turned as meshes are when they are read.

    Args:
        path: a GLB or glTF file.
        node: name of the node.
        animation: its name; None for all that move the node or what carries it.

    Attributes:
        node: its name.
        times: (K,) seconds, of all keys.
        scale: (3,), by which the node scales its mesh, always.

    Raises:
        InputError: the file is unusable, there is no such node or animation, nothing moves the node, or its scale
            changes, is mirrored or shears.
    """

    def __init__(self, path: Path, node: str, animation: str | None = None) -> None:
        self.node = node
        try:
            document, binary = chunks(path.read_bytes())
            nodes = document.get("nodes", [])
            number = node_named(nodes, node)
            self._chain = chain_to(nodes, number)
            self._tracks = tracks_of(document, Accessors(document, binary), self._chain, animation)
            self._nodes = [nodes[each] for each in self._chain]
            if still := [name_of(nodes, each) for each in self._tracks if "matrix" in nodes[each]]:
                raise UnreadableMeshError(
                    f"animates the node '{still[0]}', which has a matrix; glTF requires its parts"
                )
            tracks = [track for parts in self._tracks.values() for track in parts.values()]
            if not tracks:
                raise UnreadableMeshError(f"does not move the node '{node}'; {what_moves(document)}")
            self.times = np.unique(np.concatenate([track.times for track in tracks]))
            self.scale = self._constant_scale(node)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
        except UnreadableMeshError as error:
            raise InputError(f"{path}: {error}") from None
        except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError, struct.error) as error:
            reason = single_line(error)[:120] or type(error).__name__
            raise InputError(f"{path}: is damaged or not a glTF file ({reason}); export it again") from None

    def matrix(self, time: float) -> np.ndarray:
        """The matrix (4, 4) of the node at a time in seconds, in the axes of the file."""
        matrix = np.eye(4)
        for number, node in zip(self._chain, self._nodes, strict=True):
            values = {path: track.at(time) for path, track in self._tracks.get(number, {}).items()}
            matrix = matrix @ own_matrix({**node, **values})
        return matrix

    def pose(self, time: float) -> Pose:
        """The pose at a time in seconds, with z up."""
        matrix = self.matrix(time)
        turn = TO_Z_UP @ (matrix[:3, :3] / self.scale) @ TO_Z_UP.T
        x, y, z, w = Rotation.from_matrix(turn).as_quat()
        return Pose(TO_Z_UP @ matrix[:3, 3], np.array([w, x, y, z]))

    def pose_function(self, scale: float, offset: Vector) -> Callable[[float], Pose]:
        """The pose over time in a scene, in which lengths of the file have a ``scale`` and its origin an ``offset``."""
        origin = np.array(offset, np.float64)

        def pose(time: float) -> Pose:
            own = self.pose(time)
            return Pose(scale * own.position + origin, own.rotation)

        return pose

    def to_own(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 3) of the node at rest, with z up, in the frame whose pose is :meth:`pose`."""
        matrix = np.eye(4)
        for node in self._nodes:
            matrix = matrix @ own_matrix(node)
        in_node = np.linalg.solve(matrix[:3, :3], (points @ TO_Z_UP - matrix[:3, 3]).T).T
        own: np.ndarray = (self.scale * in_node) @ TO_Z_UP.T
        return own

    def _constant_scale(self, node: str) -> np.ndarray:
        middles = (self.times[1:] + self.times[:-1]) / 2
        matrices = np.array([self.matrix(time)[:3, :3] for time in (*self.times, *middles)])
        scales = np.linalg.norm(matrices, axis=1)  # of the columns
        if scales.min() <= 0 or not np.isfinite(scales).all():
            raise UnreadableMeshError(f"scales the node '{node}' to nothing")
        turns = matrices / scales[:, None]
        if np.abs(scales / scales[0] - 1).max() > TOLERANCE:
            raise UnreadableMeshError(f"changes the scale of the node '{node}'; a solid keeps its size")
        if np.abs(turns.transpose(0, 2, 1) @ turns - np.eye(3)).max() > TOLERANCE or np.linalg.det(turns).min() < 0:
            raise UnreadableMeshError(f"shears or mirrors the node '{node}'; apply the scale of what carries it")
        first: np.ndarray = scales[0]
        return first


def node_named(nodes: list[dict[str, Any]], name: str) -> int:
    """The number of the node with that name."""
    found = [number for number, node in enumerate(nodes) if node.get("name") == name]
    if len(found) == 1:
        return found[0]
    if found:
        raise UnreadableMeshError(f"has {len(found)} nodes with the name '{name}'; give them different ones")
    names = [str(node["name"]) for node in nodes if "name" in node]
    near = difflib.get_close_matches(name, names, n=1)
    guess = f"did you mean '{near[0]}'? " if near else ""
    listed = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
    raise UnreadableMeshError(f"has no node '{name}'; {guess}its nodes are {listed or 'without names'}")


def chain_to(nodes: list[dict[str, Any]], number: int) -> list[int]:
    """The numbers of the nodes from the root to a node, which is the last."""
    parents = {child: parent for parent, node in enumerate(nodes) for child in node.get("children", [])}
    chain = [number]
    while chain[0] in parents:
        if parents[chain[0]] in chain:
            raise UnreadableMeshError("is damaged: a node belongs to itself; export it again")
        chain.insert(0, parents[chain[0]])
    return chain


def tracks_of(document: dict[str, Any], accessors: Accessors, chain: list[int], animation: str | None) -> Tracks:
    """The tracks of the nodes in a chain."""
    animations = document.get("animations", [])
    if animation is not None:
        names = [str(each.get("name", "")) for each in animations]
        if animation not in names:
            raise UnreadableMeshError(
                f"has no animation '{animation}'; it has {', '.join(filter(None, names)) or 'none with a name'}"
            )
        animations = [each for each in animations if each.get("name") == animation]
    tracks: Tracks = {}
    for each in animations:
        for channel in each["channels"]:
            target = channel["target"]
            number, path = target.get("node"), target["path"]
            if number not in chain or path not in WIDTHS:
                continue
            if path in tracks.setdefault(number, {}):
                node = name_of(document["nodes"], number)
                raise UnreadableMeshError(f"has several animations of the node '{node}'; name one by 'animation'")
            tracks[number][path] = read_track(accessors, each["samplers"][channel["sampler"]], path)
    return {number: parts for number, parts in tracks.items() if parts}


def what_moves(document: dict[str, Any]) -> str:
    """What the animations of a file move, for a message."""
    nodes = document.get("nodes", [])
    channels = [channel for each in document.get("animations", []) for channel in each["channels"]]
    moved = dict.fromkeys(
        name_of(nodes, channel["target"]["node"]) for channel in channels if "node" in channel["target"]
    )
    listed = ", ".join(list(moved)[:NAMED])
    return f"its animations move {listed}" if moved else "it has no animation"


def name_of(nodes: list[dict[str, Any]], number: int) -> str:
    """The name of a node, or its number."""
    return str(nodes[number].get("name", number))


def animated_nodes(content: bytes) -> set[str]:
    """Names of the nodes with a mesh that an animation moves, themselves or what carries them.

    Raises:
        UnreadableMeshError: the file is damaged.
    """
    document, _ = chunks(content)
    nodes = document.get("nodes", [])
    channels = [channel for each in document.get("animations", []) for channel in each["channels"]]
    moved = {channel["target"].get("node") for channel in channels if channel["target"]["path"] in WIDTHS}
    meshes = [number for number, node in enumerate(nodes) if "mesh" in node and "name" in node]
    return {nodes[number]["name"] for number in meshes if moved & set(chain_to(nodes, number))}
