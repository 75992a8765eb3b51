"""Damaged meshes: bytes, lines and numbers of six formats, and triangles that are wrong in themselves."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

from fault_campaign import damage
from fault_campaign.inputs import QUIET
from fault_campaign.verdict import Case

FORMATS = {"obj": "obj", "stl": "stl", "ascii.stl": "stl_ascii", "ply": "ply", "off": "off", "glb": "glb"}
TEXTS = ("obj", "ascii.stl", "off")
TOLERANCE = 1e-3  # of area and box, relative
Triangles = tuple[np.ndarray, np.ndarray]


def dropped(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """Holes."""
    return mesh[0], mesh[1][random.random(len(mesh[1])) > 0.05]


def turned(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """Some faces are turned inward."""
    faces = mesh[1].copy()
    some = random.random(len(faces)) < random.uniform(0, 1)
    faces[some] = faces[some][:, ::-1]
    return mesh[0], faces


def doubled(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """Some faces come twice, some have no area."""
    faces = mesh[1]
    some = faces[random.random(len(faces)) < 0.2]
    return mesh[0], random.permutation(np.concatenate([faces, some, some[:, [0, 0, 1]]]))


def soup(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """No two triangles share a vertex."""
    return mesh[0][mesh[1].reshape(-1)], np.arange(3 * len(mesh[1])).reshape(-1, 3)


def scaled(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """Another unit, any size."""
    return mesh[0] * 10.0 ** random.uniform(-12, 20), mesh[1]


def far_away(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """Coordinates of the Earth."""
    return mesh[0] + random.uniform(-1, 1, 3) * 10.0 ** random.uniform(2, 9), mesh[1]


def not_finite(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """A vertex at infinity or nowhere."""
    vertices = mesh[0].copy()
    vertices[random.integers(len(vertices)), random.integers(3)] = random.choice([np.nan, np.inf, -np.inf, 1e300])
    return vertices, mesh[1]


def jittered(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """Faces that cut each other."""
    return mesh[0] + random.normal(0, 0.05, mesh[0].shape), mesh[1]


def flat(mesh: Triangles, random: np.random.Generator) -> Triangles:
    """No thickness."""
    return mesh[0] * [1, 1, 0], mesh[1]


# What the solid is in spite of it, if anything is right at all: itself, or whatever the triangles say.
GEOMETRY: dict[Callable[[Triangles, np.random.Generator], Triangles], bool] = {
    dropped: False, turned: True, doubled: True, soup: True, scaled: False, far_away: False, not_finite: False,
    jittered: False, flat: False,
}  # fmt: skip


def undamaged(random: np.random.Generator) -> trimesh.Trimesh:
    """A ball, a box, a ring, or two bodies."""
    shapes = (
        lambda: trimesh.creation.icosphere(1, 0.3),
        lambda: trimesh.creation.box((0.4, 0.3, 0.2)),
        lambda: trimesh.creation.torus(0.3, 0.1, 12, 8),
        lambda: trimesh.util.concatenate(
            [trimesh.creation.box((0.2, 0.2, 0.2)), trimesh.creation.icosphere(1, 0.15).apply_translation((0.4, 0, 0))]
        ),
    )
    return shapes[int(random.integers(len(shapes)))]()


def cases(random: np.random.Generator, count: int) -> Iterator[Case]:
    """Every third has wrong triangles, the others are damaged files, of all formats."""
    kinds, shapes = list(FORMATS), list(GEOMETRY)
    for number in range(count):
        suffix, mesh = kinds[number % len(kinds)], undamaged(random)
        own = np.random.default_rng(random.integers(1 << 62))
        if number % 3 == 0:
            shape = shapes[number // 3 % len(shapes)]
            vertices, faces = shape((np.asarray(mesh.vertices), np.asarray(mesh.faces)), own)
            data = exported(trimesh.Trimesh(vertices, faces, process=False), suffix)
            name, reference = shape.__name__, exported(mesh, suffix) if GEOMETRY[shape] else None
        else:
            damages = damage.ANY + damage.TEXT * (suffix in TEXTS)
            one = damages[int(own.integers(len(damages)))]
            data, name, reference = one(exported(mesh, suffix), own), one.__name__, exported(mesh, suffix)
        yield case(f"{suffix} {name} {number}", suffix, data, reference, number % 3 != 0)


def case(name: str, suffix: str, data: bytes, reference: bytes | None, other_reader: bool) -> Case:
    """Water on the damaged mesh."""
    file = f"mesh.{suffix}"

    def prepare(folder: Path) -> None:
        (folder / file).write_bytes(data)

    check = None if reference is None else partial(compare, file, reference, other_reader)
    arguments = ["simulate", file, "-o", "out", "--frames", 2, "--particle-radius", 0.04, *QUIET]
    return Case("mesh", name, arguments, prepare, check, file)


def exported(mesh: trimesh.Trimesh, suffix: str) -> bytes:
    """The file of a mesh."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        data = mesh.export(file_type=FORMATS[suffix])
    return data if isinstance(data, bytes) else data.encode()


def compare(file: str, reference: bytes, other_reader: bool, folder: Path) -> str:
    """What is wrong with the solid of an accepted file: it is neither the undamaged one nor what VTK reads."""
    from mesh_suites import by_us, by_vtk
    from surfsup.sdf.mesh.mesh_file import load_mesh

    right = folder / f"right.{file.split('.', 1)[1]}"
    right.write_bytes(reference)
    solids = [load_mesh(path) for path in (folder / file, right)]
    volumes = [float(solid.volume) for solid in solids]
    boxes = [np.ptp(np.asarray(solid.vertices), axis=0) for solid in solids]
    if np.isclose(*volumes, rtol=TOLERANCE) and np.allclose(*boxes, rtol=TOLERANCE, atol=1e-6):
        return ""
    if not other_reader:
        return f"volume {volumes[0]:.5g} instead of {volumes[1]:.5g}"
    ours, reasons = by_us(folder / file), []
    for reader in (by_vtk, by_trimesh):
        try:
            theirs = reader(folder / file)
        except Exception as error:
            reasons.append(f"{reader.__name__}: {error}")
            continue
        same = np.isclose(ours["area"], theirs["area"], rtol=TOLERANCE)
        if same and np.allclose(ours["box"], theirs["box"], rtol=TOLERANCE, atol=1e-6):
            return ""
        reasons.append(f"{reader.__name__}: area {theirs['area']:.5g} instead of {ours['area']:.5g}")
    return f"volume {volumes[0]:.5g} instead of {volumes[1]:.5g}, {', '.join(reasons)}"


def by_trimesh(path: Path) -> dict[str, object]:
    """The triangles as trimesh's reader gives them."""
    from mesh_suites import size_of

    mesh = trimesh.load(path, force="mesh", process=False)
    return size_of(np.asarray(mesh.vertices), np.asarray(mesh.faces))
