"""One web page that plays a trajectory: it opens from disk, needs no network and no server, and can be sent
to anybody.

The page is our own small WebGL program (`page/page.js`) rather than viser's exported scene: that one draws
points, not water, and is 2 MB of code before the first particle.
"""

import base64
import gzip
import json
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import trimesh

from surfsup.viewing.camera import FIELD_OF_VIEW, frame_camera

_MOST_BYTES = 10_000_000  # of positions before they are packed, which halves them
_MOST_PARTICLES = 40_000
_MOST_FACES = 120_000
_VIEW = (1200, 900)  # pixels; only their ratio matters


def write_page(
    path: str | Path,
    positions: np.ndarray,
    solid: trimesh.Trimesh | None,
    container_size: tuple[float, float, float],
    particle_radius: float,
    frame_time: float = 0.005,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write the page that plays `positions` (F, N, 3), meters, one frame every `frame_time` seconds, at
    `path`.

    Frames are left out, evenly, until the page is of a size to be sent (the page moves particles smoothly
    between those that it has), and of very many particles an even choice is shown. Positions are rounded to
    1/65535 of their extent, 0.03 mm in two meters. `container_size` is (x, y, z) in meters, x and y centered
    on 0, the floor at z = 0; `particle_radius` in meters. `progress(done, total)` is called as frames are
    packed. Raises ValueError if `positions` has another shape or no frame.
    """
    positions = np.asarray(positions)
    if positions.ndim != 3 or positions.shape[2] != 3 or 0 in positions.shape:
        raise ValueError(f"positions must be (frames, particles, 3), none of them 0; they are {positions.shape}")
    positions, stride = _thin(positions)
    packed, low, extent = _quantize(positions, progress)
    mesh = _light_mesh(solid) if solid is not None else trimesh.Trimesh()
    bounds = np.asarray(mesh.bounds) if len(mesh.faces) else None
    camera = frame_camera(container_size, bounds, positions[0], _VIEW)
    header = {
        "frames": len(positions), "particles": positions.shape[1], "frameTime": frame_time * stride,
        "radius": particle_radius, "container": list(map(float, container_size)),
        "low": low.tolist(), "extent": extent.tolist(),
        "vertices": len(mesh.vertices), "faces": len(mesh.faces),
        "eye": camera.eye.tolist(), "target": camera.target.tolist(),
        "fov": FIELD_OF_VIEW, "aspect": _VIEW[0] / _VIEW[1],
    }  # fmt: skip
    body = b"".join([
        np.asarray(mesh.faces, "<u4").tobytes(),
        np.asarray(mesh.vertices, "<f4").tobytes(),
        np.asarray(mesh.vertex_normals if len(mesh.faces) else [], "<f4").tobytes(),
        packed.tobytes(),
    ])  # fmt: skip
    data = base64.b64encode(gzip.compress(body, 6, mtime=0)).decode()
    source = files("surfsup.viewing") / "page"
    page = (source / "page.html").read_text(encoding="utf-8")
    page = page.replace("__SCRIPT__", (source / "page.js").read_text(encoding="utf-8"))
    page = page.replace("__HEADER__", json.dumps(header)).replace("__DATA__", data)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(page, encoding="utf-8")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _thin(positions: np.ndarray) -> tuple[np.ndarray, int]:
    """Fewer particles and frames of (F, N, 3), as many as a page can carry, and the stride between the
    frames kept.
    """
    positions = positions[:, :: -(-positions.shape[1] // _MOST_PARTICLES)]
    stride = max(1, -(-positions.nbytes // positions.itemsize * 2 // _MOST_BYTES))
    return positions[::stride], stride


def _quantize(
    positions: np.ndarray, progress: Callable[[int, int], None] | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """16-bit differences from frame to frame (F, N, 3), modulo 2**16, and the corner (3,) and extent (3,)
    of their grid.
    """
    finite = np.where(np.isfinite(positions), positions, 0.0)
    low = finite.min((0, 1)).astype(np.float64)
    extent = np.maximum(finite.max((0, 1)) - low, 1e-6)
    packed = np.empty(positions.shape, "<u2")
    before = np.zeros(positions.shape[1:], np.uint16)
    for frame, points in enumerate(finite):
        now = np.rint((points - low) / extent * 65535).astype(np.uint16)
        packed[frame] = now - before  # wraps around, and so does the sum in the page
        before = now
        if progress is not None:
            progress(frame + 1, len(positions))
    return packed, low, extent


def _light_mesh(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    """The solid, with normals split at sharp edges; a very fine one with its vertices merged on a grid."""
    mesh = solid
    if len(mesh.faces) > _MOST_FACES:
        # A triangle of the result is about a cell wide, so this many of them cover the surface.
        cell = float(np.sqrt(2.0 * mesh.area / _MOST_FACES))
        cells = np.rint((mesh.vertices - mesh.bounds[0]) / cell).astype(np.int64)
        _, first, which = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        faces = which.ravel()[mesh.faces]
        whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
        mesh = trimesh.Trimesh(mesh.vertices[first], faces[whole], process=False)
    return trimesh.graph.smooth_shade(mesh, angle=np.radians(40.0)) if len(mesh.faces) else mesh
