"""Rendering of water: a surface around the particles with refraction, absorption, reflection and a soft shadow.

Shading is done per pixel on the front surface, as in screen-space fluids (W. J. van der Laan, S. Green, M. Sainz,
"Screen space fluid rendering with curvature flow", I3D 2009), but on a reconstructed mesh instead of smoothed spheres.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera
from surfsup.viewing.rasterizer import triangle_mesh
from surfsup.viewing.reconstruction import Reconstruction

if TYPE_CHECKING:
    import pyvista

_ABSORPTION = np.array([15.0, 4.8, 2.3], np.float32)  # 1/m; far above real water's, because the scene is small
_SCATTERING = np.array([0.05, 0.30, 0.50], np.float32)  # color of thick water
_REFRACTION = 0.35  # sideways shift of a refracted ray, relative to the water's thickness
_REFLECTANCE = 0.02  # of water at normal incidence
_THICKNESS_CELL = 4  # pixels; thickness is smooth, so a coarse grid is enough


def reconstruct_surface(positions: np.ndarray, particle_radius: float) -> "pyvista.PolyData":
    """A closed smooth mesh around particles (N, 3), with unit vertex normals as ``Normals``; empty without particles.

    Args:
        positions: (N, 3), meters.
        particle_radius: half the particle spacing, meters.

    Raises:
        SimulationError: pysplashsurf finds no surface around these particles.
    """
    import pysplashsurf
    import pyvista

    if len(positions) == 0:
        return pyvista.PolyData()
    result = Reconstruction().mesh(positions, particle_radius)
    assert isinstance(result.mesh, pysplashsurf.TriMesh3d)  # quads are not requested
    surface = triangle_mesh(np.asarray(result.mesh.vertices), result.mesh.triangles)
    surface.point_data["Normals"] = np.asarray(result.point_attributes["normals"], np.float32)
    return surface


def water_thickness(
    positions: np.ndarray, particle_radius: float, camera: Camera, background_depth: np.ndarray
) -> np.ndarray:
    """Thickness (H, W) of the water in each pixel of ``camera``, meters, in front of ``background_depth`` (H, W)."""
    width, height = camera.size
    pixels, depth = camera.project(positions)
    cells = np.floor(pixels / _THICKNESS_CELL).astype(int)
    column, row = cells[:, 0], cells[:, 1]
    visible = (column >= 0) & (column < width // _THICKNESS_CELL) & (row >= 0) & (row < height // _THICKNESS_CELL)
    column, row, depth = column[visible], row[visible], depth[visible]
    front = depth < background_depth[row * _THICKNESS_CELL, column * _THICKNESS_CELL] + 2 * particle_radius
    cell_area = (depth[front] * _THICKNESS_CELL / camera.focal_length) ** 2
    thickness = np.zeros((height // _THICKNESS_CELL, width // _THICKNESS_CELL), np.float32)
    np.add.at(thickness, (row[front], column[front]), (2 * particle_radius) ** 3 / cell_area)
    if not front.any():
        return np.zeros((height, width), np.float32)
    blur = 1.3 * particle_radius * camera.focal_length / float(depth[front].mean()) / _THICKNESS_CELL
    return zoom(gaussian_filter(thickness, blur), _THICKNESS_CELL, order=1, grid_mode=True, mode="nearest")


def shade_water(
    normals: np.ndarray,
    rays: np.ndarray,
    depth: np.ndarray,
    thickness: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    background: np.ndarray,
    background_depth: np.ndarray,
    camera: Camera,
) -> np.ndarray:
    """Radiance (M, 3) of M pixels of water.

    Args:
        normals: (M, 3), unit, outwards.
        rays: (M, 3) of the camera.
        depth: (M,), meters.
        thickness: (M,) of the water, meters.
        rows, columns: (M,) of the pixels.
        background: (H, W, 3), the picture without water.
        background_depth: (H, W), meters.
        camera: of the picture.
    """
    view = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", normals, view)
    normals = normals + np.maximum(0.02 - cosine, 0.0)[:, None] * view  # smoothing can turn normals at the rim away
    cosine = np.clip(cosine, 0.02, 1.0)

    # Refraction: take the color of a shifted pixel, unless that pixel is in front of the water.
    height, width = background_depth.shape
    right, up, _ = camera.axes.astype(np.float32)
    shift = _REFRACTION * np.clip(thickness, 0.02, 0.2) * np.float32(camera.focal_length) / depth
    shifted_column = np.clip(columns - (shift * (normals @ right)).astype(np.int32), 0, width - 1)
    shifted_row = np.clip(rows + (shift * (normals @ up)).astype(np.int32), 0, height - 1)
    behind = background_depth[shifted_row, shifted_column] > depth
    refracted = background[np.where(behind, shifted_row, rows), np.where(behind, shifted_column, columns)]

    sun = lighting.SUN_DIRECTION.astype(np.float32)
    transmittance = np.exp(-_ABSORPTION * thickness[:, None])
    diffuse = 0.62 + 0.38 * (normals @ sun)
    body = refracted * transmittance + _SCATTERING * diffuse[:, None] * (1.0 - transmittance)
    fresnel = (_REFLECTANCE + (1 - _REFLECTANCE) * (1.0 - cosine) ** 5)[:, None]  # Schlick's approximation
    reflected = 2.0 * cosine[:, None] * normals - view
    highlight = np.clip(reflected @ sun, 0.0, 1.0) ** 160
    environment = lighting.environment_radiance(reflected)
    return body * (1.0 - fresnel) + environment * fresnel + 0.55 * highlight[:, None] * lighting.SUN_COLOR


def light_space_axes() -> np.ndarray:
    """Rows (3, 3): two directions perpendicular to the sunbeams, and the direction towards the sun."""
    right = np.cross(lighting.SUN_DIRECTION, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, lighting.SUN_DIRECTION), lighting.SUN_DIRECTION]).astype(np.float32)


def water_shadow(positions: np.ndarray, particle_radius: float, points: np.ndarray) -> np.ndarray:
    """The share (M,) of light, in (0.6, 1], that ``points`` receive below the water.

    Args:
        positions: of the particles (N, 3), meters.
        particle_radius: half the particle spacing, meters.
        points: (M, 3), meters, in the coordinates of :func:`light_space_axes`.
    """
    if len(positions) == 0:
        return np.ones(len(points), np.float32)
    local, cell = positions @ light_space_axes().T, particle_radius
    low = local[:, :2].min(0) - 6 * particle_radius
    shape = tuple(np.ceil((local[:, :2].max(0) + 6 * particle_radius - low) / cell).astype(int) + 1)
    index = tuple(((local[:, :2] - low) / cell).astype(int).T)
    thickness, height_sum = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    np.add.at(thickness, index, (2 * particle_radius) ** 3 / cell**2)
    np.add.at(height_sum, index, (2 * particle_radius) ** 3 / cell**2 * local[:, 2])
    thickness, height_sum = gaussian_filter(thickness, 2.0), gaussian_filter(height_sum, 2.0)

    column = ((points[:, 0] - low[0]) / cell).astype(np.int32)
    row = ((points[:, 1] - low[1]) / cell).astype(np.int32)
    inside = (column >= 0) & (column < shape[0]) & (row >= 0) & (row < shape[1])
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    local_thickness = thickness[column, row]
    mean_height = height_sum[column, row] / np.maximum(local_thickness, 1e-9)
    above = np.clip((mean_height - points[:, 2]) / (3 * particle_radius), 0.0, 1.0)  # 0 for points above the water
    return 1.0 - 0.4 * inside * (1.0 - np.exp(-14.0 * local_thickness)) * above
