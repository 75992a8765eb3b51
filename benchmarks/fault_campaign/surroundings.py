"""What surrounds a run is wrong: a full disk, missing libraries, an ordinary user, a second run in the folder."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from fault_campaign.inputs import QUIET, Inputs, fit_arguments, generate_arguments, train_arguments, without_graphics
from fault_campaign.kills import unreadable
from fault_campaign.program import Run, call, surfsup
from fault_campaign.verdict import verdict

LIBRARIES = ("av", "pyvista", "pysplashsurf", "pxr", "distributed", "pysplishsplash", "matplotlib", "lightning_fabric")
NO_USER = 65534


def without(*names: str) -> None:
    """A machine without some libraries."""
    without_graphics()
    for name in list(sys.modules):
        if name.partition(".")[0] in names:
            sys.modules[name] = None  # type: ignore[assignment]  # so Python marks what cannot be imported
    sys.modules.update(dict.fromkeys(names))  # type: ignore[arg-type]


def limited(size: int) -> None:
    """No file may become larger than ``size`` bytes, as on a full disk or by a quota."""
    without_graphics()
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def ordinary_user() -> None:
    """A user who owns nothing here."""
    without_graphics()
    os.environ["HOME"] = "/nonexistent"
    os.setgroups([])
    os.setgid(NO_USER)
    os.setuid(NO_USER)


def writers(inputs: Inputs) -> dict[str, list[object]]:
    """Verbs that write, with the output in "out"."""
    scene = inputs.scene
    return {
        "simulate": ["simulate", scene, "-o", "out", *QUIET],
        "simulate page": ["simulate", scene, "-o", "out", "--no-video"],
        "export npz": ["export", inputs.trajectory, "--to", "npz", "-o", "out"],
        "export usd": ["export", inputs.trajectory, "--to", "usd", "-o", "out"],
        "export blender": ["export", inputs.trajectory, "--to", "blender", "-o", "out"],
        "sweep": ["sweep", scene, "--vary", "gravity.2=-9.81,-5", "-o", "out", "--no-pictures", "--workers", 1],
        "compare": ["compare", inputs.trajectory, inputs.trajectory, "-o", "out/pair.json"],
        "evaluate": ["evaluate", "dfsph", inputs.data, "--frames", 5, "--no-video", "-o", "out"],
        "train": train_arguments(inputs, "out"),
        "fit": fit_arguments(inputs, "out.safetensors"),
        "view": ["view", inputs.trajectory, "-o", "out.html"],
        "render": ["render", inputs.trajectory, "-o", "out.mp4"],
        "convert": ["convert", scene, "-o", "out.json", "--partial"],
        "generate": generate_arguments("out", 1),
        "design": ["design", "bowl", "-o", "out", "--no-video", "--no-verification", "--iterations", 1, "--frames", 5],
    }


Before = Callable[[], None]


def runs(
    random: np.random.Generator, count: int, inputs: Inputs
) -> Iterator[tuple[str, str, Callable[[Path], tuple[str, str]]]]:
    """The first ``count`` of all."""
    for name, run in islice(everything(inputs), count):
        yield "surroundings", name, run


def everything(inputs: Inputs) -> Iterator[tuple[str, Callable[[Path], tuple[str, str]]]]:
    """All of them with their names."""
    verbs = writers(inputs)
    yield "two runs", partial(two_runs, verbs["simulate"] + ["--frames", 3000])
    for verb, arguments in verbs.items():
        yield f"{verb} over links", partial(over_links, arguments)
    for size in (4_000, 30_000, 60_000, 200_000):
        for verb, arguments in verbs.items():
            if size > 10_000 and verb in ("train", "generate", "design", "fit"):
                continue
            yield f"{verb}, files of at most {size} bytes", partial(alone, arguments, partial(limited, size))
    for verb, arguments in verbs.items():
        if os.geteuid() == 0 and verb not in ("train", "generate", "design", "fit"):
            yield f"{verb} by an ordinary user", partial(alone, arguments, ordinary_user)
    for library in LIBRARIES:
        for verb, arguments in verbs.items():
            if verb in ("train", "generate", "design", "fit") and library not in ("lightning_fabric", "pysplishsplash"):
                continue
            yield f"{verb} without {library}", partial(alone, arguments, partial(without, library))


def alone(arguments: list[object], before: Before, folder: Path) -> tuple[str, str]:
    """A run that may refuse, but leaves nothing half-written under a final name."""
    kind, reason = verdict(surfsup(arguments, folder, before))
    if wrong := call(partial(unreadable, folder)):
        return "lost or half-written", f"{kind}: {wrong}"
    shutil.rmtree(folder, ignore_errors=True)
    return kind, reason


def over_links(arguments: list[object], folder: Path) -> tuple[str, str]:
    """A run into a folder, as a stranger may have made it, whose files are links: what they lead to stays as it is."""
    surfsup(arguments, folder, without_graphics)
    (folder / "kept").mkdir()
    kept: dict[Path, bytes] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()):
        target = folder / "kept" / f"{len(kept)}{path.suffix}"
        kept[target] = path.read_bytes()
        path.rename(target)
        path.symlink_to(target)
    kind, reason = verdict(surfsup(arguments, folder, without_graphics))
    if changed := [path.name for path, content in kept.items() if path.read_bytes() != content]:
        return "wrote elsewhere", f"{kind}: through a link to {', '.join(changed)}"
    return kind, reason


def two_runs(arguments: list[object], folder: Path) -> tuple[str, str]:
    """The second run into a folder is refused, and the first one ends as if it had been alone."""
    first = Run(arguments, folder, without_graphics)
    while not (folder / "out" / "trajectory.h5").exists() and first.poll_only() is None:
        time.sleep(0.02)
    kind, reason = verdict(surfsup(arguments, folder, without_graphics), "another run")
    ended = verdict(first.wait(240))
    if kind != "refused":
        return "lost or half-written", f"the second run was not refused: {kind} {reason}"
    if ended[0] != "accepted":
        return "lost or half-written", f"the first run ended so: {ended[0]} {ended[1]}"
    wrong = call(partial(unreadable, folder))
    return ("lost or half-written", wrong) if wrong else (kind, reason)
