"""USD: one file with all frames, for usdview, Omniverse, Houdini, Blender and Maya.

The time code of a frame is its number, from 1. Velocities are in m/s, as the schemas UsdGeomPoints and UsdGeomMesh
require for motion blur.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt

from surfsup.errors import InputError
from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame, solid_mesh
from surfsup.exporting.sequence import check_overwrite
from surfsup.exporting.solids import SolidMeshes
from surfsup.exporting.up_axis import UpAxis, with_up_axis
from surfsup.exporting.usd_transforms import TransformSamples, prim_names
from surfsup.viewing.liquid_look import DISPLAY_COLOR, Rgb

FRAMES_PER_SAVE = 8  # unsaved frames are in memory
SOLID_COLOR = (0.6, 0.6, 0.6)
STILL = "still"  # the mesh of what stands still, where others move


def open_writer(folder: Path, fps: float, up: UpAxis, overwrite: bool, colors: Sequence[Rgb]) -> UsdWriter:
    """A writer of ``water.usdc`` in ``folder``."""
    return UsdWriter(folder / "water.usdc", fps, up, overwrite, colors)


class UsdWriter:
    """Writes ``/Water/Particles``, ``/Water/Surface`` and ``/Water/Solid`` into one file.

    Of several liquids each has a surface, ``/Water/Surface_0``, ``/Water/Surface_1``. Where solids move,
    ``/Water/Solid`` has a mesh for each, with its way as a transform, and one of those that stand still. The file
    appears under its name only when it is complete.
    """

    def __init__(
        self, path: Path, fps: float, up: UpAxis, overwrite: bool, colors: Sequence[Rgb] = (DISPLAY_COLOR,)
    ) -> None:
        """Write the file ``path``.

        Args:
            path: the new file.
            fps: time codes per second.
            up: upward axis.
            overwrite: whether an existing file is replaced.
            colors: of the liquids.

        Raises:
            InputError: the file exists or cannot be written.
        """
        check_overwrite([path], overwrite)
        self._path, self._colors = path, colors
        self._partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        self._partial.unlink(missing_ok=True)
        try:
            self._stage = Usd.Stage.CreateNew(str(self._partial))
        except Tf.ErrorException:
            raise InputError(f"{path}: cannot be written") from None
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.y if up == "y" else UsdGeom.Tokens.z)
        self._stage.SetTimeCodesPerSecond(fps)
        self._stage.SetFramesPerSecond(fps)
        self._stage.SetDefaultPrim(UsdGeom.Xform.Define(self._stage, "/Water").GetPrim())
        self._frames: dict[str, int] = {}
        self._ways: TransformSamples | None = None

    def particles(self, frame: ParticleFrame) -> None:
        """Write the particles of the next frame, with the attributes ``widths``, ``ids`` and ``velocities``.

        Particles of several liquids have the primvar ``liquid``, their number."""
        code, points = self._next("Particles"), UsdGeom.Points.Define(self._stage, "/Water/Particles")
        positions = vectors(frame.positions)
        widths = Vt.FloatArray(len(positions), 2 * frame.radius)
        points.CreatePointsAttr().Set(positions, code)
        points.CreateVelocitiesAttr().Set(vectors(frame.velocities), code)
        points.CreateIdsAttr().Set(Vt.Int64Array.FromNumpy(frame.ids.astype(np.int64)), code)
        points.CreateWidthsAttr().Set(widths, code)
        points.CreateExtentAttr().Set(UsdGeom.Points.ComputeExtent(positions, widths), code)
        if frame.liquids is None:
            color(points, self._colors[0])
        else:
            kind, varying = Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.varying
            numbers = UsdGeom.PrimvarsAPI(points).CreatePrimvar("liquid", kind, varying)
            numbers.Set(Vt.IntArray.FromNumpy(frame.liquids.astype(np.int32)), code)
            shown = points.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
            shown.Set(vectors(np.array(self._colors)[frame.liquids]), code)
        self._save(code)

    def surface(self, frame: MeshFrame) -> None:
        """Write the water's surface of the next frame, or that of one of several liquids."""
        name = "Surface" if frame.liquid is None else f"Surface_{frame.liquid}"
        code = self._next(name)
        mesh = self._mesh(f"/Water/{name}", frame, code, self._colors[frame.liquid or 0])
        mesh.CreateVelocitiesAttr().Set(vectors(frame.velocities), code)
        self._save(code)

    def solid(self, frame: MeshFrame) -> None:
        """Write the solid, which does not move."""
        self._mesh("/Water/Solid", frame, Usd.TimeCode.Default(), SOLID_COLOR)

    def moving_solids(self, solids: SolidMeshes, time: float, up: UpAxis) -> None:
        """Write where the solids are in the next frame; their meshes, with the first one."""
        if self._ways is None:
            self._ways = self._moving_meshes(solids, up)
        code = self._next("Solid")
        for solid in solids.moving:
            self._ways.add(solid.name, solids.pose_of(solid, time), code)
        self._save(code)

    def _moving_meshes(self, solids: SolidMeshes, up: UpAxis) -> TransformSamples:
        """Write the meshes of all solids, each in its own frame."""
        UsdGeom.Xform.Define(self._stage, "/Water/Solid")
        names = prim_names((solid.name for solid in solids.moving), taken=STILL)
        if solids.still is not None:
            still = with_up_axis(solids.still, up)
            self._mesh(f"/Water/Solid/{STILL}", still, Usd.TimeCode.Default(), SOLID_COLOR)
        meshes = {}
        for solid in solids.moving:
            own = with_up_axis(solid_mesh(solid.mesh), up)
            path = f"/Water/Solid/{names[solid.name]}"
            meshes[solid.name] = self._mesh(path, own, Usd.TimeCode.Default(), SOLID_COLOR)
        return TransformSamples(meshes, up)

    def finish(self) -> list[Path]:
        """Complete the file and return it."""
        if frames := max(self._frames.values(), default=0):
            self._stage.SetStartTimeCode(1)
            self._stage.SetEndTimeCode(frames)
        self._write()
        self._stage = None  # closes the file
        self._partial.replace(self._path)
        return [self._path]

    def close(self) -> None:
        """Remove an incomplete file."""
        self._stage = None
        self._partial.unlink(missing_ok=True)

    def _next(self, name: str) -> int:
        self._frames[name] = self._frames.get(name, 0) + 1
        return self._frames[name]

    def _mesh(self, prim: str, frame: MeshFrame, code: int | Usd.TimeCode, rgb: Rgb) -> UsdGeom.Mesh:
        mesh, points = UsdGeom.Mesh.Define(self._stage, prim), vectors(frame.vertices)
        mesh.CreatePointsAttr().Set(points, code)
        mesh.CreateFaceVertexCountsAttr().Set(Vt.IntArray(len(frame.triangles), 3), code)
        mesh.CreateFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(frame.triangles.ravel()), code)
        mesh.CreateNormalsAttr().Set(vectors(frame.normals), code)
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateExtentAttr().Set(UsdGeom.PointBased.ComputeExtent(points), code)
        color(mesh, rgb)
        return mesh

    def _save(self, code: int) -> None:
        if code % FRAMES_PER_SAVE == 0:
            self._write()

    def _write(self) -> None:
        try:
            self._stage.GetRootLayer().Save()
        except Tf.ErrorException:
            raise InputError(f"{self._path}: cannot be written; is the disk full?") from None


def vectors(values: np.ndarray) -> Vt.Vec3fArray:
    """Vectors (N, 3) as an array of USD."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def color(shape: UsdGeom.Gprim, rgb: Rgb) -> None:
    """Give a shape one color."""
    shape.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*rgb)]))
