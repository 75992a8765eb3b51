"""Public meshes read by surfsup and by VTK's readers, compared by area, volume and box.

    python benchmarks/mesh_suites.py FOLDER [FOLDER ...] [--table docs/mesh-suites.md]

Each folder is a suite: all of its OBJ, STL, PLY, OFF and GLB files, below it, too. Every file is read in a process of
its own, which has some seconds. The result is a JSON file (benchmarks/results/mesh_suites.json) with a row for each
mesh, and a page with a table.
"""

from __future__ import annotations

import argparse
import multiprocessing
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import igl  # noqa: F401  loaded once, before the processes
import numpy as np
import trimesh  # noqa: F401
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import record
from surfsup.errors import InputError
from surfsup.sdf.mesh.cleaning import clean
from surfsup.sdf.mesh.mesh_file import read_mesh
from surfsup.sdf.mesh.topology import area_vectors

SUFFIXES = (".obj", ".stl", ".ply", ".off", ".glb")
LIMIT = 40  # seconds a mesh
TOLERANCE = 1e-4  # of area and box, relative: VTK reads in single precision
Row = dict[str, Any]


def size_of(vertices: np.ndarray, faces: np.ndarray) -> Row:
    """Area, volume and sides of the box of triangles."""
    corners = vertices[faces]
    box = np.ptp(corners.reshape(-1, 3), axis=0)
    vectors = area_vectors(vertices, faces)
    offset = corners.mean(axis=1) - corners.reshape(-1, 3).mean(axis=0)
    return {
        "triangles": len(faces),
        "area": float(np.linalg.norm(vectors, axis=1).sum()),
        "volume": float((offset * vectors).sum() / 3),
        "box": box.tolist(),
    }


def by_us(path: Path) -> Row:
    """The triangles as they are read, and what becomes of them as a solid."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        raw, kind = read_mesh(path.read_bytes(), path)
        row = {"format": kind, **size_of(raw.vertices, raw.faces)}
        try:
            solid = clean(raw.vertices, raw.faces, path)
            row["solid_volume"] = float(solid.volume)
        except InputError as error:
            row["solid_refused"] = reason(error)
    row["warnings"] = [reason(one.message) for one in caught]
    return row


def by_vtk(path: Path) -> Row:
    """The triangles as VTK's reader for the suffix gives them."""
    vtk.vtkObject.GlobalWarningDisplayOff()
    readers = {
        ".obj": vtk.vtkOBJReader,
        ".stl": vtk.vtkSTLReader,
        ".ply": vtk.vtkPLYReader,
        ".off": vtk.vtkOFFReader,
        ".glb": vtk.vtkGLTFReader,
    }
    reader = readers[path.suffix.lower()]()
    reader.SetFileName(str(path))
    reader.Update()
    port = reader.GetOutputPort()
    if path.suffix.lower() == ".glb":
        flat = vtk.vtkCompositeDataGeometryFilter()
        flat.SetInputConnection(port)
        port = flat.GetOutputPort()
    triangles = vtk.vtkTriangleFilter()
    triangles.PassLinesOff()
    triangles.PassVertsOff()
    triangles.SetInputConnection(port)
    triangles.Update()
    mesh = triangles.GetOutput()
    if mesh.GetNumberOfPolys() == 0:
        raise ValueError("no triangles")
    faces = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return size_of(vtk_to_numpy(mesh.GetPoints().GetData()).astype(np.float64), faces)


def reason(error: object) -> str:
    """A message without the path of the file."""
    return str(error).split(": ", 1)[-1][:200]


def work(read: Callable[[Path], Row], path: Path, pipe: Any) -> None:
    """Send the row of a mesh, or why there is none."""
    try:
        row = read(path)
    except InputError as error:
        row = {"refused": reason(error)}
    except Exception as error:
        row = {"failed": f"{type(error).__name__}: {error}"[:200]}
    pipe.send(row)


def in_a_process(read: Callable[[Path], Row], path: Path) -> Row:
    """The row of a mesh by a process that may crash or take too long."""
    ours, theirs = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.get_context("fork").Process(target=work, args=(read, path, theirs))
    process.start()
    theirs.close()
    try:
        row = ours.recv() if ours.poll(LIMIT) else {"failed": f"no answer in {LIMIT} s"}
    except EOFError:
        row = {"failed": "crashed"}
    process.kill()
    process.join()
    return row


def verdict(ours: Row, vtks: Row) -> str:
    """How both readings compare."""
    if "failed" in ours:
        return "failed"
    if "refused" in ours:
        return "refused by both" if "area" not in vtks else "refused, VTK reads"
    if "area" not in vtks:
        return "read, VTK fails"
    mine, other = (np.array([row["area"] ** 0.5, *row["box"]]) for row in (ours, vtks))
    scale = max(mine.max(), 1e-300)
    return "same" if np.abs(mine - other).max() < TOLERANCE * scale else "differs"


def table(rows: list[Row]) -> str:
    """The page with the counts of each suite and every mesh on which the readers differ."""
    verdicts = ("same", "read, VTK fails", "refused by both", "refused, VTK reads", "differs", "failed")
    lines = ["| suite | meshes | " + " | ".join(verdicts) + " |", "|---|" + "---|" * (1 + len(verdicts))]
    for suite in sorted({row["suite"] for row in rows}):
        own = [row for row in rows if row["suite"] == suite]
        counts = Counter(row["verdict"] for row in own)
        lines.append(f"| {suite} | {len(own)} | " + " | ".join(str(counts[one]) for one in verdicts) + " |")
    counts = Counter(row["verdict"] for row in rows)
    lines.append(f"| all | {len(rows)} | " + " | ".join(str(counts[one]) for one in verdicts) + " |")
    lines += ["", "| suite | mesh | verdict | surfsup | VTK |", "|---|---|---|---|---|"]
    for row in rows:
        if row["verdict"] not in ("same", "refused by both"):
            cells = (row["suite"], row["mesh"], row["verdict"], brief(row["ours"]), brief(row["vtk"]))
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def brief(row: Row) -> str:
    """A reading in one cell of the table."""
    if "area" not in row:
        return str(row.get("refused") or row.get("failed")).replace("|", "/")
    return f"{row['triangles']} triangles, area {row['area']:.5g}, box " + " x ".join(
        f"{side:.4g}" for side in row["box"]
    )


def outcome(row: Row) -> str:
    """What becomes of a mesh as a solid."""
    if "solid_volume" in row:
        return "; ".join([f"solid of volume {row['solid_volume']:.5g}", *row["warnings"]])
    return str(row.get("solid_refused", ""))


def main() -> None:
    """Read all meshes of all suites."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--table", type=Path, help="write the table to this file")
    arguments = parser.parse_args()
    rows: list[Row] = []
    for folder in arguments.folders:
        for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()):
            ours, vtks = in_a_process(by_us, path), in_a_process(by_vtk, path)
            name = path.relative_to(folder).as_posix()
            row = {"suite": folder.name, "mesh": name, "verdict": verdict(ours, vtks), "ours": ours, "vtk": vtks}
            print(folder.name, name, row["verdict"], flush=True)
            rows.append(row)
    record.write_result(
        "mesh_suites",
        f"Meshes of {len(arguments.folders)} public suites that are read or refused in one line, of {len(rows)}",
        sum(row["verdict"] != "failed" for row in rows),
        "meshes",
        "VTK's readers, read at all",
        sum("area" in row["vtk"] for row in rows),
        "python benchmarks/mesh_suites.py FOLDER [FOLDER ...]",
        {
            "verdicts": dict(Counter(row["verdict"] for row in rows)),
            "meshes": {
                f"{row['suite']}/{row['mesh']}": [
                    row["verdict"],
                    *(brief(row["ours"]), brief(row["vtk"]), outcome(row["ours"])),
                ]
                for row in rows
            },
        },
    )
    text = table(rows)
    print(text)
    if arguments.table:
        arguments.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
