"""Kills at a random moment of every verb that writes, beside the result of an earlier run where the verb replaces one.

A kill may cost the work of the run, or of its last seconds, but nothing else: what stands under its final name is
complete, an earlier result is as it was or replaced as a whole, and the same command then succeeds in the same folder.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from fault_campaign.inputs import QUIET, Inputs, fit_arguments, generate_arguments, train_arguments, without_graphics
from fault_campaign.program import Run, call, surfsup
from fault_campaign.verdict import verdict

SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
LIMIT = 240.0  # seconds that the run after a kill may take


@dataclass(frozen=True)
class Verb:
    """A verb that writes.

    Attributes:
        arguments: of surfsup, with the output in "out".
        again: what the run after the kill adds.
        longest: seconds until the kill, at most.
        earlier: whether a complete run is in the folder before.
    """

    arguments: list[object]
    again: tuple[str, ...]
    longest: float
    earlier: bool


def verbs(inputs: Inputs) -> dict[str, Verb]:
    """All of them."""
    sweep = ["sweep", inputs.scene, "--vary", "gravity.2=-9.81,-5,-3", "-o", "out", "--no-pictures", "--workers", 1]
    design = ["design", "bowl", "-o", "out", "--no-video", "--no-verification", "--iterations", 2, "--frames", 5]
    return {
        "simulate": Verb(["simulate", inputs.scene, "-o", "out", "--frames", 600, *QUIET], (), 1.5, True),
        "simulate --resume": Verb(
            ["simulate", inputs.scene, "-o", "out", "--frames", 600, *QUIET], ("--resume",), 1.5, False
        ),
        "export": Verb(
            ["export", inputs.trajectory, "--to", "ply", "-o", "out", "--fps", 200], ("--overwrite",), 0.6, False
        ),
        "export usd": Verb(["export", inputs.trajectory, "--to", "usd", "-o", "out", "--overwrite"], (), 0.6, True),
        "sweep": Verb(sweep, (), 2.5, False),
        "generate": Verb(generate_arguments("out", 2), (), 6, False),
        "train": Verb([*train_arguments(inputs, "out"), "steps=40"], ("--resume",), 3, False),
        "fit": Verb([*fit_arguments(inputs, "out.safetensors"), "steps=400"], ("--resume",), 3, False),
        "design": Verb(design, ("--resume",), 6, False),
    }


# Those that are cheap are killed more often; of 20.
SHARES = {
    "simulate": 5, "simulate --resume": 3, "export": 3, "export usd": 2, "sweep": 2, "generate": 1, "train": 2,
    "fit": 1, "design": 1,
}  # fmt: skip


def runs(
    random: np.random.Generator, count: int, inputs: Inputs
) -> Iterator[tuple[str, str, Callable[[Path], tuple[str, str]]]]:
    """All kills."""
    known = verbs(inputs)
    order = [name for name, share in SHARES.items() for _ in range(share)]
    for number in range(count):
        name = order[(number * 7) % len(order)]
        moment = float(random.uniform(0.02, known[name].longest))
        one = SIGNALS[int(random.integers(len(SIGNALS)))]
        yield "kill", f"{name} {one.name} after {moment:.2f} s", partial(kill, known[name], moment, one)


def kill(verb: Verb, moment: float, number: signal.Signals, folder: Path) -> tuple[str, str]:
    """What a kill leaves."""
    if verb.earlier:
        surfsup(
            [*verb.arguments, "--frames", 30] if "simulate" in verb.arguments else verb.arguments,
            folder,
            without_graphics,
        )
    run = Run(verb.arguments, folder, without_graphics)
    time.sleep(moment)
    if run.poll_only() is None:
        run.send(number)
    outcome = run.wait()
    kind, reason = verdict(outcome)
    if outcome.status == -number:
        kind = "killed"
    if kind not in ("killed", "interrupted", "accepted", "warned"):
        return kind, reason
    if wrong := call(partial(unreadable, folder)):
        return "lost or half-written", wrong
    if verb.earlier and not any((folder / "out").iterdir()):
        return "lost or half-written", "the earlier result is gone"
    ended = kind == "accepted" and verb.again == ("--resume",)
    if ended:
        return kind, ""
    again = surfsup([*verb.arguments, *verb.again], folder, without_graphics, LIMIT)
    next_kind, reason = verdict(again)
    nothing_yet = next_kind == "refused" and (
        "nothing" in reason or "there is no" in reason or "has all" in reason or "has no frames" in reason
    )
    if next_kind == "refused" and verb.again == ("--resume",) and nothing_yet:
        again = surfsup(verb.arguments, folder, without_graphics, LIMIT)
        next_kind, reason = verdict(again)
    if next_kind not in ("accepted", "warned"):
        return (next_kind if next_kind != "refused" else "lost or half-written"), f"then: {reason}"
    if wrong := call(partial(unreadable, folder)):
        return "lost or half-written", f"then: {wrong}"
    if left := [path.name for path in folder.rglob("*") if path.name.endswith((".partial", ".lock", ".new.h5"))]:
        return "lost or half-written", f"the next run left {', '.join(left)}"
    return kind, ""


def unreadable(folder: Path) -> str:
    """The first file under a final name that is not complete."""
    for path in sorted(folder.rglob("*")):
        reader = READERS.get(path.suffix)
        partial = any(part.startswith(".") for part in path.relative_to(folder).parts) or ".new" in path.name
        if reader is None or not path.is_file() or partial:
            continue
        try:
            reader(path)
        except Exception as error:
            return f"{path.name}: {type(error).__name__}: {error}"
    return ""


def read_trajectory(path: Path) -> None:
    """Open it as `--resume` and `export` do, and read what it has."""
    from surfsup.io.cut_off import open_readable

    with open_readable(path) as trajectory:
        len(trajectory)


def read_tensors(path: Path) -> None:
    """Read all tensors."""
    from surfsup.checked.tensors import read_tensors as read

    read(path)


def read_json(path: Path) -> None:
    """Read it."""
    import json

    json.loads(path.read_text())


def read_mesh(path: Path) -> None:
    """The particles of a frame."""
    import pyvista

    if pyvista.read(path).n_points == 0:
        raise ValueError("has no points")


def read_usd(path: Path) -> None:
    """Open the stage."""
    from pxr import Usd

    Usd.Stage.Open(str(path))


READERS: dict[str, Callable[[Path], None]] = {
    ".h5": read_trajectory,
    ".safetensors": read_tensors,
    ".json": read_json,
    ".ply": read_mesh,
    ".usdc": read_usd,
}
