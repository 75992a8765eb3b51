"""The picture without water, as a camera sees it. It is drawn once; frames only add the water."""

from __future__ import annotations

import numpy as np

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera
from surfsup.viewing.lit_solid import LitSolid
from surfsup.viewing.pixel_box import PixelBox
from surfsup.viewing.rasterizer import Rasterizer
from surfsup.viewing.viewpoint import SUPERSAMPLING, Viewpoint, coarse_mean, repeated


class StaticView:
    """Solid, floor and backdrop.

    Attributes:
        viewpoint: of the camera.
        fine_radiance, fine_depth: (3, 2 H, 2 W) and (2 H, 2 W) of the samples: linear color, and meters along the view,
            infinite in the backdrop.
        radiance, depth: (3, H, W) and (H, W) of the pixels; the depth is that of one of their samples.
    """

    def __init__(self, solid: LitSolid, viewpoint: Viewpoint, rasterizer: Rasterizer) -> None:
        self.viewpoint = viewpoint
        self.radiance = viewpoint.floor_radiance(solid)
        self.fine_radiance, self.fine_depth = repeated(self.radiance), viewpoint.floor_depth.copy()
        if solid.mesh is not None:
            camera = viewpoint.camera
            box = PixelBox.around(camera.project(solid.mesh.vertices)[0], 2, camera.size)
            rasterizer.set_perspective(camera, box, SUPERSAMPLING, *clipping_range(camera))
            rasterizer.set_mesh(solid.mesh.vertices, solid.mesh.faces, solid.colors)
            depth, part = rasterizer.render_depth(), box.slices(SUPERSAMPLING)
            visible = depth < self.fine_depth[part]
            self.fine_radiance[:, *part][:, visible] = lighting.LINEAR_FROM_BYTE[rasterizer.color()[visible].T]
            self.fine_depth[part][visible] = depth[visible]
            self.radiance[:, *box.slices()] = coarse_mean(self.fine_radiance[:, *part])
        self.depth = self.fine_depth[::SUPERSAMPLING, ::SUPERSAMPLING]


def clipping_range(camera: Camera) -> tuple[float, float]:
    """The near and the far clipping plane, meters: a few meters around the target."""
    distance = float(np.linalg.norm(camera.target - camera.eye))
    return 0.1 * distance, 2.5 * distance
