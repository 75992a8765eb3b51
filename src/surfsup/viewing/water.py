"""Water in a picture: a surface around the particles, lit so that it bends, tints and reflects what is around
it.

The light is computed a pixel at a time on what is seen first, as screen-space fluids are (van der Laan,
Green and Sainz,
"Screen space fluid rendering with curvature flow", 2009), but on a reconstructed surface instead of on
smoothed spheres.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

from surfsup.errors import SimulationError
from surfsup.viewing import light
from surfsup.viewing.camera import Camera

if TYPE_CHECKING:
    import pysplashsurf
    import pyvista

ABSORPTION = np.array([15.0, 4.8, 2.3], np.float32)  # a meter; far more than water's, for the scene is a meter wide
BODY = np.array([0.05, 0.30, 0.50], np.float32)  # what thick water scatters back
_REFRACTION = 0.35  # how far (share of the depth of water) a ray is bent aside
_REFLECTANCE = 0.02  # of water seen straight on
_CELLS = (0.7, 0.705, 0.71)  # sizes of the grid's cells, in radii of a particle
_COARSE = 4  # pixels; thickness is smooth, so it is gathered on a coarser grid


def water_surface(positions: np.ndarray, particle_radius: float) -> "pyvista.PolyData":
    """A closed smooth mesh around particles (N, 3), by pysplashsurf, with unit vertex normals as `Normals`.

    `particle_radius` is in meters, half the particles' spacing. Empty where there are no particles.

    Raises:
        SimulationError: pysplashsurf finds no surface around these particles.
    """
    import pyvista

    if len(positions) == 0:
        return pyvista.PolyData()
    mesh = reconstruct(np.ascontiguousarray(positions, np.float32), particle_radius)
    # Its triangles are unsigned, which VTK misreads.
    triangles = np.asarray(mesh.mesh.triangles).astype(np.int64)
    surface = pyvista.PolyData.from_regular_faces(np.asarray(mesh.mesh.vertices), triangles)
    surface.point_data["Normals"] = np.asarray(mesh.point_attributes["normals"], np.float32)
    return surface


def reconstruct(positions: np.ndarray, particle_radius: float) -> "pysplashsurf.MeshWithData":
    """The mesh as pysplashsurf makes it.

    Raises:
        SimulationError: it can make none.
    """
    import pysplashsurf

    # Now and then it loses a vertex and gives up ("This is a bug"); on a grid of other cells it does not.
    for cell in _CELLS:
        try:
            mesh, _ = pysplashsurf.reconstruction_pipeline(
                positions,
                particle_radius=particle_radius, smoothing_length=2.0, cube_size=cell, iso_surface_threshold=0.6,
                mesh_smoothing_iters=20, mesh_smoothing_weights=True, compute_normals=True, normals_smoothing_iters=8,
            )  # fmt: skip
        except RuntimeError:
            continue
        return mesh
    raise SimulationError(f"pysplashsurf finds no surface around the {len(positions)} particles")


def thickness(positions: np.ndarray, particle_radius: float, camera: Camera, behind: np.ndarray) -> np.ndarray:
    """Meters of water (H, W) that each pixel of `camera` looks through, in front of the depth `behind`
    (H, W).
    """
    width, height = camera.size
    pixels, depth = camera.project(positions)
    cells = np.floor(pixels / _COARSE).astype(int)
    column, row = cells[:, 0], cells[:, 1]
    seen = (column >= 0) & (column < width // _COARSE) & (row >= 0) & (row < height // _COARSE)
    column, row, depth = column[seen], row[seen], depth[seen]
    front = depth < behind[row * _COARSE, column * _COARSE] + 2 * particle_radius
    a_cell = (depth[front] * _COARSE / camera.pixels_a_meter) ** 2
    water = np.zeros((height // _COARSE, width // _COARSE), np.float32)
    np.add.at(water, (row[front], column[front]), (2 * particle_radius) ** 3 / a_cell)
    if not front.any():
        return np.zeros((height, width), np.float32)
    blur = 1.3 * particle_radius * camera.pixels_a_meter / float(depth[front].mean()) / _COARSE
    return zoom(gaussian_filter(water, blur), _COARSE, order=1, grid_mode=True, mode="nearest")


def shade(
    normals: np.ndarray, rays: np.ndarray, depth: np.ndarray, water: np.ndarray, rows: np.ndarray, columns:
    np.ndarray, behind: np.ndarray, behind_depth: np.ndarray, camera: Camera,
) -> np.ndarray:  # fmt: skip
    """Light (M, 3) of M pixels of water at `rows`, `columns` (M,).

    `normals` (M, 3) unit and outwards, `rays` (M, 3) of the camera, `depth` (M,) and `water` (M,), its
    thickness, in meters; `behind` (H, W, 3) and `behind_depth` (H, W): the picture without water.
    """
    view = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
    facing = np.einsum("ij,ij->i", normals, view)
    normals = normals + np.maximum(0.02 - facing, 0.0)[:, None] * view  # smoothing may have turned a rim's normal away
    facing = np.clip(facing, 0.02, 1.0)

    # Refraction: look at what lies aside, unless that stands in front of the water.
    height, width = behind_depth.shape
    right, up, _ = camera.axes.astype(np.float32)
    bend = _REFRACTION * np.clip(water, 0.02, 0.2) * np.float32(camera.pixels_a_meter) / depth
    aside_column = np.clip(columns - (bend * (normals @ right)).astype(np.int32), 0, width - 1)
    aside_row = np.clip(rows + (bend * (normals @ up)).astype(np.int32), 0, height - 1)
    fits = behind_depth[aside_row, aside_column] > depth
    through = behind[np.where(fits, aside_row, rows), np.where(fits, aside_column, columns)]

    clear = np.exp(-ABSORPTION * water[:, None])
    diffuse = 0.62 + 0.38 * (normals @ light.SUN.astype(np.float32))
    body = through * clear + BODY * diffuse[:, None] * (1.0 - clear)
    fresnel = (_REFLECTANCE + (1 - _REFLECTANCE) * (1.0 - facing) ** 5)[:, None]
    reflected = 2.0 * facing[:, None] * normals - view
    glint = np.clip(reflected @ light.SUN.astype(np.float32), 0.0, 1.0) ** 160
    return body * (1.0 - fresnel) + light.surroundings(reflected) * fresnel + 0.55 * glint[:, None] * light.SUN_COLOR


def sun_axes() -> np.ndarray:
    """Rows (3, 3): two directions across the sunbeams, and the one towards the sun."""
    right = np.cross(light.SUN, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, light.SUN), light.SUN]).astype(np.float32)


def sunlight(positions: np.ndarray, particle_radius: float, along: np.ndarray) -> np.ndarray:
    """The share (M,), in (0.6, 1], of their light that points still get past the water before the sun.

    `along` (M, 3) are the points, meters, in the axes of `sun_axes`: they stand still, so that is done once.
    """
    if len(positions) == 0:
        return np.ones(len(along), np.float32)
    axes = sun_axes()
    local, cell = positions @ axes.T, particle_radius
    low = local[:, :2].min(0) - 6 * particle_radius
    shape = tuple(np.ceil((local[:, :2].max(0) + 6 * particle_radius - low) / cell).astype(int) + 1)
    index = tuple(((local[:, :2] - low) / cell).astype(int).T)
    water, towards = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    np.add.at(water, index, (2 * particle_radius) ** 3 / cell**2)
    np.add.at(towards, index, (2 * particle_radius) ** 3 / cell**2 * local[:, 2])
    water, towards = gaussian_filter(water, 2.0), gaussian_filter(towards, 2.0)

    column = ((along[:, 0] - low[0]) / cell).astype(np.int32)
    row = ((along[:, 1] - low[1]) / cell).astype(np.int32)
    inside = (column >= 0) & (column < shape[0]) & (row >= 0) & (row < shape[1])
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    dense = water[column, row]
    above = towards[column, row] / np.maximum(dense, 1e-9) - along[:, 2]  # how far up the sunbeam the water hangs
    return 1.0 - 0.4 * inside * (1.0 - np.exp(-14.0 * dense)) * np.clip(above / (3 * particle_radius), 0.0, 1.0)
