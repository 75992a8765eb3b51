"""USD: one file with all frames, for usdview, Omniverse, Houdini, Blender and Maya.

The time code of a frame is its number, from 1. Velocities are in m/s, as the schemas UsdGeomPoints and UsdGeomMesh
require for motion blur.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt

from surfsup.errors import InputError
from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame
from surfsup.exporting.sequence import check_overwrite
from surfsup.exporting.solids import SolidMeshes
from surfsup.exporting.up_axis import UpAxis, with_up_axis

FRAMES_PER_SAVE = 8  # unsaved frames are in memory
WATER_COLOR, SOLID_COLOR = (0.25, 0.5, 0.8), (0.6, 0.6, 0.6)


def open_writer(folder: Path, fps: float, up: UpAxis, overwrite: bool) -> UsdWriter:
    """A writer of ``water.usdc`` in ``folder``."""
    return UsdWriter(folder / "water.usdc", fps, up, overwrite)


class UsdWriter:
    """Writes ``/Water/Particles``, ``/Water/Surface`` and ``/Water/Solid`` into one file.

    The file appears under its name only when it is complete.
    """

    def __init__(self, path: Path, fps: float, up: UpAxis, overwrite: bool) -> None:
        """Write the file ``path``.

        Args:
            path: the new file.
            fps: time codes per second.
            up: upward axis.
            overwrite: whether an existing file is replaced.

        Raises:
            InputError: the file exists or cannot be written.
        """
        check_overwrite([path], overwrite)
        self._path = path
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
        self._frames = {"Particles": 0, "Surface": 0, "Solid": 0}

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
        color(points, WATER_COLOR)
        if frame.liquids is not None:
            kind, varying = Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.varying
            numbers = UsdGeom.PrimvarsAPI(points).CreatePrimvar("liquid", kind, varying)
            numbers.Set(Vt.IntArray.FromNumpy(frame.liquids.astype(np.int32)), code)
        self._save(code)

    def surface(self, frame: MeshFrame) -> None:
        """Write the water's surface of the next frame."""
        code = self._next("Surface")
        mesh = self._mesh("/Water/Surface", frame, code, WATER_COLOR)
        mesh.CreateVelocitiesAttr().Set(vectors(frame.velocities), code)
        self._save(code)

    def solid(self, frame: MeshFrame) -> None:
        """Write the solid, which does not move."""
        self._mesh("/Water/Solid", frame, Usd.TimeCode.Default(), SOLID_COLOR)

    def moving_solids(self, solids: SolidMeshes, time: float, up: UpAxis) -> None:
        """Write the solids of the next frame."""
        code, frame = self._next("Solid"), with_up_axis(solids.at(time), up)
        mesh = self._mesh("/Water/Solid", frame, code, SOLID_COLOR)
        mesh.CreateVelocitiesAttr().Set(vectors(frame.velocities), code)
        self._save(code)

    def finish(self) -> list[Path]:
        """Complete the file and return it."""
        if frames := max(self._frames.values()):
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
        self._frames[name] += 1
        return self._frames[name]

    def _mesh(
        self, prim: str, frame: MeshFrame, code: int | Usd.TimeCode, rgb: tuple[float, float, float]
    ) -> UsdGeom.Mesh:
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


def color(shape: UsdGeom.Gprim, rgb: tuple[float, float, float]) -> None:
    """Give a shape one color."""
    shape.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*rgb)]))
