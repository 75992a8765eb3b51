"""The scenes that ship: in the folder `examples` of the repository, or of the installed package."""

from __future__ import annotations

from pathlib import Path

import surfsup
from surfsup.errors import InputError, did_you_mean

SUFFIXES = (".yaml", ".obj")


def examples_folder() -> Path | None:
    """The folder with the examples; None where the package came without them."""
    package = Path(surfsup.__file__).parent
    return next((folder for folder in (package / "examples", package.parents[1] / "examples") if folder.is_dir()), None)


def example_files() -> dict[str, Path]:
    """The examples by name."""
    folder = examples_folder()
    found = [] if folder is None else [path for path in sorted(folder.iterdir()) if path.suffix in SUFFIXES]
    return {path.stem: path for path in found}


def example_file(name: str) -> Path:
    """The file of an example.

    Raises:
        InputError: there is no such example.
    """
    known = example_files()
    if name not in known:
        hint = did_you_mean(name, known)
        raise InputError(f"there is no example '{name}'{hint}; there are {', '.join(known) or 'none installed'}")
    return known[name]


def description(path: Path) -> str:
    """The first sentence of an example's comment."""
    if path.suffix != ".yaml":
        return "A mesh that water falls on"
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# ") or line.startswith("#  "):
            break
        lines.append(line[2:].strip())
    return " ".join(lines).partition(". ")[0].rstrip(".")
