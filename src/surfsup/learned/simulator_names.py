"""The names of simulators, without the libraries that compute."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from surfsup.errors import InputError, did_you_mean

DEFAULT_SIMULATOR, FAST_SIMULATOR = "dfsph", "dfsph-fast"


def shipped() -> dict[str, Path]:
    """The weights files that come with the package, by name."""
    folder = Path(str(files("surfsup.learned") / "weights"))
    return {path.stem: path for path in sorted(folder.glob("*.safetensors"))}


def simulator_names() -> list[str]:
    """The names of simulators that need no file, the default first."""
    return [DEFAULT_SIMULATOR, FAST_SIMULATOR, *shipped()]


def require_simulator(name: str) -> None:
    """Require that ``name`` is that of a simulator, or a file.

    Raises:
        InputError: it is neither.
    """
    known = simulator_names()
    if name not in known and not Path(name).is_file():
        hint = did_you_mean(name, known)
        raise InputError(
            f"there is no simulator '{name}'{hint}; known are {', '.join(known)}, or give a .safetensors file"
        )
