"""Results of benchmarks as JSON files, which the tables in README.md and docs/benchmarks.md are generated from.

Every file of `benchmarks/results/` holds one claim: the figure, the peer's figure, the command that measured both, and
where they come from. So a number and its date, commit and machine cannot part.

| key | type | meaning |
|---|---|---|
| `name` | text | name of the file without `.json` |
| `claim` | text | what is measured, in one phrase |
| `figure` | number or text | the project's figure; text for a range of several runs |
| `unit` | text | unit of both figures |
| `peer` | text or null | what it is compared with |
| `peer_figure` | number, text or null | the peer's figure |
| `command` | text | the command that measures both |
| `values` | object | everything else that was measured |
| `date` | text | day of the measurement, YYYY-MM-DD |
| `commit` | text or null | commit of this repository, with `+` if files were changed |
| `machine` | object | `cpu`, `isa` (instruction set), `cores`, `threads` |
| `versions` | object | version of every library that counts |
| `source` | text | `measured`, or where a transcribed figure was written down |
"""

from __future__ import annotations

import datetime
import json
import os
import subprocess
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
RESULTS = Path(__file__).parent / "results"
LIBRARIES = ("surfsup", "torch", "warp-lang", "numpy", "pysplishsplash")

Figure = float | str


@dataclass(frozen=True)
class Result:
    """One claim with its provenance. The module's docstring explains the attributes."""

    name: str
    claim: str
    figure: Figure
    unit: str
    peer: str | None
    peer_figure: Figure | None
    command: str
    date: str
    commit: str | None
    machine: Mapping[str, Any]
    versions: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    source: str = "measured"


def write_result(
    name: str,
    claim: str,
    figure: Figure,
    unit: str,
    peer: str | None,
    peer_figure: Figure | None,
    command: str,
    values: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Path:
    """Write one claim, as measured now on this machine, and return its file.

    Args:
        name: name of the file without ``.json``.
        claim: what is measured, in one phrase.
        figure: the project's figure.
        unit: unit of both figures.
        peer: what the figure is compared with; None if there is no peer.
        peer_figure: the peer's figure.
        command: the command that measures both.
        values: everything else that was measured.
        threads: threads of the measured process; None: those that OMP_NUM_THREADS or the number of cores allows.
    """
    result = Result(
        name=name,
        claim=claim,
        figure=figure,
        unit=unit,
        peer=peer,
        peer_figure=peer_figure,
        command=command,
        date=datetime.date.today().isoformat(),
        commit=commit(),
        machine=machine(threads),
        versions=library_versions(),
        values=dict(values or {}),
    )
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(asdict(result), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


def read_result(name: str) -> Result:
    """The claim of that name.

    Raises:
        FileNotFoundError: there is no such file.
        TypeError: a key is missing or unknown.
    """
    return Result(**json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8")))


def machine(threads: int | None = None) -> dict[str, Any]:
    """CPU model, instruction set of the native code, cores and threads."""
    from surfsup import native

    sets = native.instruction_sets()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    chosen = threads or int(os.environ.get("OMP_NUM_THREADS", cores or 1))
    return {"cpu": cpu_model(), "isa": sets[0] if sets else "none", "cores": cores, "threads": chosen}


def cpu_model() -> str:
    """The name that the processor gives itself."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")


def library_versions() -> dict[str, str]:
    """Versions of the libraries that are installed."""
    found = {}
    for library in LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:
            continue
    return found


def commit() -> str | None:
    """Short hash of the current commit, with ``+`` if tracked files were changed; None outside a repository."""

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "--short", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return None
