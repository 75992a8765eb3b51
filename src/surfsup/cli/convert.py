"""`surfsup convert`: scenes of SPlisHSPlasH, and assemblies of meshes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.options import UpAxis, positive_length
from surfsup.errors import InputError

if TYPE_CHECKING:
    from surfsup.splishsplash.converted_scene import ConvertedScene

NAMED = 5  # missing things that the message lists


def convert(
    scene: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE",
            help="A scene of SPlisHSPlasH (.json) or of ours (.yaml); or a folder of meshes or a glTF scene.",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="The new file: .yaml, or .json for SPlisHSPlasH.")],
    partial: Annotated[bool, typer.Option("--partial", help="Leave out what the other program does not have.")] = False,
    fit: Annotated[float, typer.Option(help="Largest extent of an assembly in meters.")] = 0.7,
    no_fit: Annotated[bool, typer.Option("--no-fit", help="Keep the coordinates of an assembly, in meters.")] = False,
    up: UpAxis = None,
) -> None:
    """Convert a scene from or to SPlisHSPlasH, or the parts of an assembly to solids by name.

    Example: surfsup convert DamBreakModelDragons.json -o dragons.yaml
    """
    if not scene.exists():
        raise InputError(f"{scene}: does not exist; check the path")
    from surfsup.scene import Scene
    from surfsup.scene.assembly import GLTF, write_assembly
    from surfsup.splishsplash.scene_export import export_scene
    from surfsup.splishsplash.scene_import import import_scene

    kinds = scene.suffix.lower(), out.suffix.lower()
    yaml = (".yaml", ".yml")
    if (scene.is_dir() or kinds[0] in GLTF) and kinds[1] in yaml:
        parts = write_assembly(scene, out, None if no_fit else positive_length(fit), up)
        typer.echo(f"solids {', '.join(parts)}")
        typer.echo(f"scene  {out}")
        return
    converted: ConvertedScene
    if kinds[0] == ".json" and kinds[1] in yaml:
        converted, other = import_scene(scene, out), "surfsup"
    elif kinds[0] in yaml and kinds[1] == ".json":
        converted, other = export_scene(Scene.load(scene), out), "a scene file of SPlisHSPlasH"
    else:
        raise InputError(f"{scene} and {out}: one must be .json, of SPlisHSPlasH, the other .yaml, of surfsup")
    check_complete(scene, converted.missing, other, partial)
    converted.write()
    for phrase in converted.missing:
        typer.echo(f"left out: {phrase}")
    typer.echo(f"scene  {out}")


def check_complete(scene: Path, missing: list[str], other: str, partial: bool) -> None:
    """Refuse an incomplete conversion.

    Raises:
        InputError: something is missing, and that was not allowed.
    """
    if missing and not partial:
        listed = "; ".join(missing[:NAMED]) + ("; ..." if len(missing) > NAMED else "")
        raise InputError(f"{scene}: has what {other} does not: {listed}. --partial converts the rest")
