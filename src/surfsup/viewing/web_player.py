"""One web page that plays a trajectory. It opens from disk and needs no network and no server.

The page is a small WebGL program of its own (``pages/player.js``). The exported scene of viser would draw points
instead of water, and has 2 MB of code before the first particle.
"""

import base64
import html
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np
import trimesh
from isal import igzip

from surfsup.viewing.camera import FIELD_OF_VIEW, fit_camera, picture_scale
from surfsup.viewing.html_page import script_json, write_html
from surfsup.viewing.liquid_look import WATER, LiquidLook
from surfsup.viewing.moving_mesh import MovingMesh, bounds_of, scaled_poses

_MAX_BYTES = 10_000_000  # of positions before compression, which halves them
_MAX_PARTICLES = 40_000
_MAX_FACES = 120_000
_VIEW_SIZE = (1200, 900)  # pixels; only the aspect ratio matters


def write_web_player(
    path: str | Path,
    positions: np.ndarray,
    solid: trimesh.Trimesh | None,
    container_size: tuple[float, float, float],
    particle_radius: float,
    frame_time: float = 0.005,
    progress: Callable[[int, int], None] = lambda done, total: None,
    moving: Sequence[MovingMesh] = (),
    container_poses: np.ndarray | None = None,
    is_open: bool = False,
    title: str = "surfsup",
    simulator: str = "",
    focus: np.ndarray | None = None,
    looks: Sequence[LiquidLook] = (WATER,),
    liquids: np.ndarray | None = None,
) -> None:
    """Write the page that plays ``positions`` at ``path``.

    Long trajectories keep every n-th frame, and the page interpolates between them. Of too many particles every n-th is
    shown. Positions are quantized to 1/65535 of their extent, 0.03 mm in two meters.

    Args:
        path: of the page; missing folders are made.
        positions: (frames, particles, 3), meters. A particle that is not finite is not shown.
        solid: the mesh of the solid, or None.
        container_size: (x, y, z), meters; x and y are centered on 0, the floor is at z = 0.
        particle_radius: half the particle spacing, meters.
        frame_time: seconds.
        progress: called with the numbers of finished and of all frames.
        moving: the solids that move.
        container_poses: (frames, 7) of a container that moves.
        is_open: whether the container has no walls; then its edges are not drawn.
        title: of the page.
        simulator: the name of what made the trajectory, shown beside the title with the number of particles.
        focus: points (N, 3) that the camera shows, meters; by default the particles of the first frame.
        looks: of the liquids.
        liquids: (particles,), which of them each particle is; None for the first.

    Raises:
        ValueError: ``positions`` has another shape, or no frames or particles.
    """
    positions = np.asarray(positions)
    if positions.ndim != 3 or positions.shape[2] != 3 or 0 in positions.shape:
        raise ValueError(f"positions must be (frames, particles, 3), none of them 0; they are {positions.shape}")
    scale = picture_scale(container_size, particle_radius)
    count = positions.shape[1]
    liquids = np.zeros(count, "<u2") if liquids is None else liquids.astype("<u2")
    focus = positions[0] if focus is None else focus
    positions, stride = _subsample(positions)
    shown = "" if positions.shape[1] == count else f", {positions.shape[1]:,} of them shown"
    caption = " · ".join([title, *([simulator] if simulator else []), f"{count:,} particles{shown}"])
    if scale != 1:
        focus = scale * focus
        positions = scale * positions
        solid = solid.copy().apply_scale(scale) if solid is not None else None
        moving = [body.scaled(scale) for body in moving]
        container_poses = None if container_poses is None else scaled_poses(container_poses, scale)
        container_size = (scale * container_size[0], scale * container_size[1], scale * container_size[2])
    differences, low, extent = _quantize(positions, progress)
    mesh = _simplify(solid) if solid is not None else trimesh.Trimesh()
    bodies = [_simplify(body.mesh) for body in moving]
    poses = [body.poses for body in moving] + ([] if container_poses is None else [container_poses])
    bounds = bounds_of(mesh if len(mesh.faces) else None, moving)
    camera = fit_camera(container_size, bounds, focus[np.isfinite(focus).all(1)], _VIEW_SIZE)
    header = {
        "frames": len(positions), "particles": positions.shape[1], "frameTime": frame_time * stride,
        "radius": scale * particle_radius, "scale": scale, "container": list(map(float, container_size)),
        "low": low.tolist(), "extent": extent.tolist(),
        "vertices": len(mesh.vertices), "faces": len(mesh.faces),
        "moving": [{"vertices": len(body.vertices), "faces": len(body.faces)} for body in bodies],
        "containerMoves": container_poses is not None, "open": is_open,
        "liquids": [{name: values.tolist() for name, values in vars(look).items()} for look in looks],
        "eye": camera.eye.tolist(), "target": camera.target.tolist(),
        "fov": FIELD_OF_VIEW, "aspect": _VIEW_SIZE[0] / _VIEW_SIZE[1],
    }  # fmt: skip
    body = b"".join([
        *(_mesh_bytes(part) for part in (mesh, *bodies)),
        *(np.asarray(path[: len(positions) * stride : stride], "<f4").tobytes() for path in poses),
        liquids[:: _particle_stride(count)].tobytes(),
        differences.tobytes(),
    ])  # fmt: skip
    # ISA-L is ten times as fast as zlib, and the page up to a tenth larger.
    pages = files("surfsup.viewing") / "pages"
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    values = {
        "SCRIPT": (pages / "player.js").read_text(encoding="utf-8"),
        "HEADER": script_json(header),
        "TITLE": html.escape(title),
        "CAPTION": html.escape(caption),
        "DATA": base64.b64encode(igzip.compress(body, 3, mtime=0)).decode(),
    }
    write_html(path, pages / "player.html", values)


def _mesh_bytes(mesh: trimesh.Trimesh) -> bytes:
    """Faces, vertices and normals of a mesh as the page reads them."""
    normals = mesh.vertex_normals if len(mesh.faces) else []
    return b"".join(
        np.asarray(values, kind).tobytes()
        for values, kind in ((mesh.faces, "<u4"), (mesh.vertices, "<f4"), (normals, "<f4"))
    )


def _subsample(positions: np.ndarray) -> tuple[np.ndarray, int]:
    """Fewer particles and frames of (F, N, 3), and the stride between the kept frames."""
    positions = positions[:, :: _particle_stride(positions.shape[1])]
    stride = max(1, -(-positions.size * 2 // _MAX_BYTES))
    return positions[::stride], stride


def _particle_stride(count: int) -> int:
    """Of so many particles every how many-th is shown."""
    return -(-count // _MAX_PARTICLES)


def _quantize(positions: np.ndarray, progress: Callable[[int, int], None]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """16-bit differences from frame to frame (F, N, 3), modulo 2**16, and corner and extent (3,) of their grid.

    A particle that is not finite has the value 65535 on all axes, which the page does not draw.
    """
    shown = np.isfinite(positions).all(2)
    finite = np.where(shown[..., None], positions, positions[shown][:1] if shown.any() else 0.0)
    low = finite.min((0, 1)).astype(np.float64)
    extent = np.maximum(finite.max((0, 1)) - low, 1e-6)
    extent *= 65535 / 65534  # so that no particle that is shown has the value of those that are not
    differences = np.empty(positions.shape, "<u2")
    previous = np.zeros(positions.shape[1:], np.uint16)
    for frame, points in enumerate(finite):
        current = np.rint((points - low) / extent * 65535).astype(np.uint16)
        current[~shown[frame]] = 65535
        differences[frame] = current - previous  # wraps around, and so does the sum in the page
        previous = current
        progress(frame + 1, len(positions))
    return differences, low, extent


def _simplify(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    """The solid with normals split at sharp edges; vertices of a very fine mesh are merged on a grid."""
    mesh = solid
    if len(mesh.faces) > _MAX_FACES:
        # The merged triangles are about as large as a cell, so about this many cover the surface.
        cell = float(np.sqrt(2.0 * mesh.area / _MAX_FACES))
        cells = np.rint((mesh.vertices - mesh.bounds[0]) / cell).astype(np.int64)
        _, first, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        faces = inverse.ravel()[mesh.faces]
        valid = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
        mesh = trimesh.Trimesh(mesh.vertices[first], faces[valid], process=False)
    return trimesh.graph.smooth_shade(mesh, angle=np.radians(40.0)) if len(mesh.faces) else mesh
