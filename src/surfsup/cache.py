"""Results that take long, kept by their content: arrays in safetensors files in the user's cache folder.

The name of an entry is the hash of all that its arrays follow from: the inputs, the code of this package and the
versions of the libraries. So an entry is never out of date, and results are the same with and without the cache.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

MAX_BYTES = 1_000_000_000  # of all entries; those used longest ago are deleted
FORMAT = 1
SUFFIX = ".safetensors"
CODE_FOLDERS = ("native", "scene", "sdf", "sph")  # whose results are kept, and whose constants they use
LIBRARIES = ("dracopy", "libigl", "mapbox-earcut", "numpy", "scipy", "torch", "trimesh")
CHECKSUM = "sha256"

Arrays = dict[str, np.ndarray]
Part = bytes | str | float | np.ndarray | None


def folder() -> Path:
    """The cache folder: ``SURFSUP_CACHE`` or, without it, ``surfsup`` in ``XDG_CACHE_HOME`` or ``~/.cache``."""
    if chosen := os.environ.get("SURFSUP_CACHE"):
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "surfsup"


def digest(*parts: Part) -> bytes:
    """The SHA-256 of ``parts``, different for all that differs in type, shape or value."""
    result = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            content = np.ascontiguousarray(part)
            header, data = f"{content.dtype.str}{content.shape}", content.tobytes()
        elif isinstance(part, bytes):
            header, data = "bytes", part
        else:
            header, data = type(part).__name__, repr(part).encode()
        result.update(f"{header} {len(data)} ".encode() + data)
    return result.digest()


def cached(kind: str, key: bytes, compute: Callable[[], Arrays]) -> Arrays:
    """The arrays of an earlier call with the same ``key``, or those of ``compute``, which are kept.

    A folder that cannot be used, or an entry that is damaged, costs time but is no error.

    Args:
        kind: what the arrays are, for the name of the file.
        key: :func:`digest` of all that ``compute`` uses.
        compute: computes the arrays.
    """
    path = folder() / f"{kind}-{digest(FORMAT, kind, code_version(), key).hex()}{SUFFIX}"
    arrays = read(path)
    if arrays is None:
        arrays = compute()
        write(path, arrays)
    return arrays


@cache
def code_version() -> bytes:
    """The digest of the code that computes kept results: this package's, and the versions of the libraries."""
    package = Path(__file__).parent
    files = [
        file for name in CODE_FOLDERS for file in (package / name).rglob("*") if file.suffix in (".py", ".so", ".pyd")
    ]
    contents = [digest(str(file.relative_to(package)), file.read_bytes()) for file in sorted(files)]
    return digest(*contents, *(version_of(library) for library in LIBRARIES))


def version_of(library: str) -> str | None:
    """The version of an installed library, None if it is not installed."""
    try:
        return version(library)
    except PackageNotFoundError:
        return None


def read(path: Path) -> Arrays | None:
    """The arrays of an entry; None if there is none, or it is damaged."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="np") as file:
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no mapping
            checksum = (file.metadata() or {}).get(CHECKSUM)
    except (OSError, SafetensorError, ValueError, KeyError):
        return None
    if checksum != checksum_of(arrays):
        return None
    with contextlib.suppress(OSError):  # a folder that can only be read serves, too
        os.utime(path)  # the latest use
    return arrays


def write(path: Path, arrays: Arrays) -> None:
    """Write an entry, then delete the entries used longest ago while all together take more than MAX_BYTES."""
    from safetensors.numpy import save

    content = save(
        {name: np.ascontiguousarray(array) for name, array in arrays.items()}, {CHECKSUM: checksum_of(arrays)}
    )
    if len(content) > MAX_BYTES:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".partial", delete=False) as file:
            partial = Path(file.name)
            try:
                file.write(content)
                file.close()
                partial.replace(path)
            finally:
                partial.unlink(missing_ok=True)
        evict()
    except OSError:
        return


def checksum_of(arrays: Arrays) -> str:
    """The checksum of the arrays of an entry."""
    return digest(*(part for name in sorted(arrays) for part in (name, arrays[name]))).hex()


def entries() -> list[tuple[float, int, Path]]:
    """Time of last use, bytes and path of every entry, and of what an interrupted write left; oldest first."""
    found = []
    for path in folder().glob("*"):
        try:
            if path.suffix in (SUFFIX, ".partial"):
                found.append((path.stat().st_mtime, path.stat().st_size, path))
        except OSError:
            continue  # another process deleted it
    return sorted(found)


def size() -> int:
    """Bytes of all entries."""
    return sum(taken for _, taken, _ in entries())


def evict() -> None:
    """Delete the entries used longest ago while all together take more than MAX_BYTES."""
    total = size()
    for _, taken, path in entries():
        if total <= MAX_BYTES:
            return
        path.unlink(missing_ok=True)
        total -= taken


def is_writable() -> bool:
    """Whether entries can be kept."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder()):
            return True
    except OSError:
        return False
