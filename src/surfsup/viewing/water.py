"""Rendering of water: a surface around the particles with refraction, absorption and reflection.

Shading is done per pixel on the front surface, as in screen-space fluids (W. J. van der Laan, S. Green, M. Sainz,
"Screen space fluid rendering with curvature flow", I3D 2009), but on a reconstructed mesh instead of smoothed spheres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera
from surfsup.viewing.liquid_look import LiquidLook
from surfsup.viewing.pixel_box import PixelBox
from surfsup.viewing.reconstruction import Reconstruction
from surfsup.viewing.shading_mesh import ShadingMesh

# 1/m, of scattering; the same for all colors, or thin water over brown would look olive. With half of it, thin water
# over a solid in the shade was nearly black.
_TURBIDITY = np.float32(12.0)
_REFRACTION = 0.35  # sideways shift of a refracted ray, relative to the water's thickness
_REFLECTANCE = 0.02  # of water at normal incidence
_THICKNESS_CELL = 2  # pixels; thickness is smooth, so a coarse grid is enough


def reconstruct_surface(positions: np.ndarray, particle_radius: float) -> ShadingMesh:
    """The surface around particles (N, 3); empty without particles.

    Args:
        positions: (N, 3), meters.
        particle_radius: half the particle spacing, meters.

    Raises:
        SimulationError: pysplashsurf finds no surface around these particles.
    """
    import pysplashsurf

    if len(positions) == 0:
        return ShadingMesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.int64), np.empty((0, 3), np.float32))
    result = Reconstruction().mesh(positions, particle_radius)
    assert isinstance(result.mesh, pysplashsurf.TriMesh3d)  # quads are not requested
    # A vertex of only degenerate triangles has no normal; it covers no pixel, so any normal will do.
    normals = np.nan_to_num(np.asarray(result.point_attributes["normals"], np.float32))
    return ShadingMesh(np.asarray(result.mesh.vertices), np.asarray(result.mesh.triangles), normals)


def water_thickness(
    positions: np.ndarray, particle_radius: float, camera: Camera, box: PixelBox, background_depth: np.ndarray
) -> np.ndarray:
    """Thickness (h, w) of the water in the pixels of a box, meters, in front of ``background_depth`` (h, w)."""
    width, height = box.size
    shape = -(-height // _THICKNESS_CELL), -(-width // _THICKNESS_CELL)
    pixels, depth = camera.project(positions)
    column, row = (np.floor((pixels - [box.left, box.top]) / _THICKNESS_CELL).astype(int)).T
    visible = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
    column, row, depth = column[visible], row[visible], depth[visible]
    front = depth < background_depth[row * _THICKNESS_CELL, column * _THICKNESS_CELL] + 2 * particle_radius
    column, row, depth = column[front], row[front], depth[front]
    if len(depth) == 0:
        return np.zeros((height, width), np.float32)
    cell_area = (depth * _THICKNESS_CELL / camera.focal_length) ** 2
    volume = (2 * particle_radius) ** 3 / cell_area
    thickness = np.bincount(row * shape[1] + column, volume, shape[0] * shape[1]).reshape(shape).astype(np.float32)
    blur = 1.3 * particle_radius * camera.focal_length / float(depth.mean()) / _THICKNESS_CELL
    blurred = gaussian_filter(thickness, blur, mode="constant")
    return zoom(blurred, _THICKNESS_CELL, order=1, grid_mode=True, mode="nearest")[:height, :width]


@dataclass(frozen=True)
class Samples:
    """Points (M,) of a picture where water is in front.

    Attributes:
        normals: (3, M), unit, outwards.
        views: (3, M), unit, towards the camera.
        depth: (M,), meters.
        thickness: (M,) of the water, meters.
        look: of the liquid, or of each ray's mean.
        rows, columns: (M,) in the grid of the background.
    """

    normals: np.ndarray
    views: np.ndarray
    depth: np.ndarray
    thickness: np.ndarray
    look: LiquidLook
    rows: np.ndarray
    columns: np.ndarray


@dataclass(frozen=True)
class Background:
    """What is behind the water, on a grid of pixels or of samples.

    Attributes:
        radiance: the colors (3, M) at rows and columns (M,).
        depth: (H, W), meters.
        focal_length: in cells of the grid.
    """

    radiance: Callable[[np.ndarray, np.ndarray], np.ndarray]
    depth: np.ndarray
    focal_length: float


def shade_water(samples: Samples, background: Background, axes: np.ndarray) -> np.ndarray:
    """Radiance (3, M) of a liquid, seen by a camera with ``axes`` (3, 3): right, up and forward."""
    view, depth, thickness = samples.views, samples.depth, samples.thickness
    cosine = np.einsum("ij,ij->j", samples.normals, view)
    # smoothing can turn normals at the rim away
    normals = samples.normals + np.maximum(np.float32(0.02) - cosine, np.float32(0)) * view
    cosine = np.clip(cosine, np.float32(0.02), np.float32(1))

    # Refraction: take the color of a shifted pixel, unless that pixel is in front of the water.
    height, width = background.depth.shape
    right, up, _ = axes.astype(np.float32)
    shift = np.float32(_REFRACTION * background.focal_length) * np.clip(thickness, 0.02, 0.2) / depth
    columns = np.clip(samples.columns - (shift * (right @ normals)).astype(np.int32), 0, width - 1)
    rows = np.clip(samples.rows + (shift * (up @ normals)).astype(np.int32), 0, height - 1)
    behind = background.depth[rows, columns] > depth
    refracted = background.radiance(np.where(behind, rows, samples.rows), np.where(behind, columns, samples.columns))

    sun = lighting.SUN_DIRECTION.astype(np.float32)
    absorption, scattering = (value.reshape(3, -1) for value in (samples.look.absorption, samples.look.scattering))
    transmittance = np.exp(-absorption * thickness)
    diffuse = np.float32(0.62) + np.float32(0.38) * (sun @ normals)
    scattered = 1 - np.exp(-_TURBIDITY * thickness)
    body = refracted * transmittance + scattering * (diffuse * scattered)
    grazing = 1 - cosine
    fresnel = np.float32(_REFLECTANCE) + np.float32(1 - _REFLECTANCE) * grazing**5  # Schlick's approximation
    reflected = 2 * cosine * normals - view
    highlight = np.clip(sun @ reflected, 0, 1) ** np.float32(160)
    environment = lighting.environment_radiance(reflected)
    return body + fresnel * (environment - body) + np.float32(0.55) * highlight * lighting.SUN_COLOR[:, None]
