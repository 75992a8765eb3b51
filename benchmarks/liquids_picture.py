"""Two liquids in Blender: the .blend file of `--to blender` as it was written, with another camera.

    surfsup examples oil-and-water -o out/oil
    python benchmarks/liquids_picture.py out/oil

Writes `docs/images/export-liquids.png`. Needs the extra `export` and the package `bpy`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import surfsup as sf
from record import ROOT

RENDER = """
import bpy
from mathutils import Vector
bpy.ops.wm.open_mainfile(filepath={blend!r})
scene = bpy.context.scene
scene.frame_set(30)
scene.render.resolution_x, scene.render.resolution_y = 640, 420
scene.cycles.samples, scene.cycles.use_denoising, scene.render.use_motion_blur = 64, False, False
camera = scene.camera
camera.location, camera.data.lens, camera.data.clip_start = (0.26, -0.36, 0.2), 78, 0.01
camera.rotation_euler = (Vector((0, 0, 0.045)) - camera.location).to_track_quat("-Z", "Y").to_euler()
scene.render.filepath = {out!r}
bpy.ops.render.render(write_still=True)
"""


def main() -> None:
    """Export and render."""
    out = ROOT / "docs" / "images" / "export-liquids.png"
    with tempfile.TemporaryDirectory() as folder:
        sf.export(sys.argv[1], "blender", folder, fps=24)
        rendered = Path(folder) / "picture.png"
        script = RENDER.format(blend=str(Path(folder) / "water.blend"), out=str(rendered))
        subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
        image = Image.open(rendered).convert("RGB")
    image.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(out, optimize=True)


if __name__ == "__main__":
    main()
