"""The same water in the formats that Blender opens, each imported by Blender's own importer and rendered by it.

    surfsup simulate examples/knot.obj -o out/knot
    python benchmarks/export_pictures.py out/knot/trajectory.h5

Exports the trajectory as USD, Alembic, PLY, GLB and OBJ, opens each in a process of its own and writes
`docs/images/export-formats.png`. Needs the extra `export` and the package `bpy`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import surfsup as sf
from record import ROOT

SIZE, SAMPLES, FRAME = (320, 280), 24, 17
# Importers of Blender; files of a single frame are those of FRAME.
IMPORTERS = {
    "usd": ("water.usdc", "bpy.ops.wm.usd_import(filepath={file!r})"),
    "alembic": ("water.abc", "bpy.ops.wm.alembic_import(filepath={file!r}, as_background_job=False)"),
    "ply": ("surface.{number:04d}.ply", "bpy.ops.wm.ply_import(filepath={file!r}, forward_axis='Y', up_axis='Z')"),
    "glb": ("surface.{number:04d}.glb", "bpy.ops.import_scene.gltf(filepath={file!r})"),
    "obj": ("surface.{number:04d}.obj", "bpy.ops.wm.obj_import(filepath={file!r}, forward_axis='Y', up_axis='Z')"),
}
RENDER = """
import bpy, sys
from mathutils import Vector
bpy.ops.wm.read_factory_settings(use_empty=True)
scene, objects = bpy.context.scene, bpy.data.objects
scene.render.fps = 24
{imports}
scene.frame_set({number})

def material(name, color, **inputs):
    made = bpy.data.materials.new(name)
    node = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    node.inputs["Base Color"].default_value = (*color, 1)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return made

water = material("W", (0.1, 0.4, 0.75), Roughness=0.12)
solid = material("S", (0.5, 0.25, 0.13), Roughness=0.6)
for shape in [each for each in objects if each.type in ("MESH", "POINTCLOUD")]:
    if "Particles" in shape.name:
        shape.hide_render = True
        continue
    shape.data.materials.clear()
    shape.data.materials.append(solid if "olid" in shape.name else water)
bpy.ops.mesh.primitive_plane_add(size=30)
bpy.context.object.data.materials.append(material("F", (0.6, 0.62, 0.65), Roughness=0.9))
lamp = objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
lamp.data.energy, lamp.data.angle, lamp.rotation_euler = 3.0, 0.2, (0.6, -0.3, 0.0)
camera = objects.new("Camera", bpy.data.cameras.new("Camera"))
camera.location, camera.data.lens = (1.5, -2.6, 1.6), 72.0
camera.rotation_euler = (Vector((0, 0, 0.28)) - camera.location).to_track_quat("-Z", "Y").to_euler()
for made in (lamp, camera):
    scene.collection.objects.link(made)
scene.camera, scene.world = camera, bpy.data.worlds.new("World")
sky = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND").inputs
sky["Color"].default_value, sky["Strength"].default_value = (0.7, 0.82, 1.0, 1.0), 0.6
scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", {samples}, False
scene.render.resolution_x, scene.render.resolution_y = {size}
scene.render.filepath = {out!r}
bpy.ops.render.render(write_still=True)
"""


def picture(name: str, folder: Path) -> np.ndarray:
    """The picture (height, width, 3) that Blender renders of a format's files in a folder."""
    pattern, importer = IMPORTERS[name]
    files = [folder / pattern.format(number=FRAME)]
    if "{number" in pattern:
        files.append(folder / f"solid{Path(pattern).suffix}")
    imports = "\n".join(importer.format(file=str(file)) for file in files)
    if len(files) > 1:  # the names of objects are those of the files, but in GLB
        imports = imports.replace("\n", "\nfor each in objects: each.name = 'Surface'\n")
        imports += "\nfor each in objects:\n    if each.name != 'Surface': each.name = 'Solid'"
    out = folder / f"{name}.png"
    script = RENDER.format(imports=imports, number=FRAME, samples=SAMPLES, size=SIZE, out=str(out))
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
    return np.asarray(Image.open(out).convert("RGB"))


def main() -> None:
    """Export, render and join."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trajectory", type=Path)
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "docs" / "images" / "export-formats.png")
    arguments = parser.parse_args()
    pictures = []
    for name in IMPORTERS:
        with tempfile.TemporaryDirectory() as folder:
            sf.export(arguments.trajectory, name, folder, fps=24, what="all")
            pictures.append(picture(name, Path(folder)))
        print(name, flush=True)
    joined = Image.fromarray(np.hstack(pictures))
    joined.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(arguments.out, optimize=True)


if __name__ == "__main__":
    main()
