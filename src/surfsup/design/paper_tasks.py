"""What a user asked to be designed, as tasks, each with its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from surfsup.design.paper.bowl import bowl
from surfsup.design.paper.funnel import funnel
from surfsup.design.task import Task
from surfsup.errors import InputError

CHAIRS = "chairs"  # the shipped network of chairs
VESSELS: dict[str, Callable[..., Task]] = {"bowl": bowl, "funnel": funnel}


def asked_tasks(
    name: str,
    out: Path,
    starts: list[str] | None,
    frames: int | None,
    deepsdf: Path | None = None,
    shape: str | None = None,
) -> list[tuple[Path, Task]]:
    """One task a start; with several each has a folder of its own in ``out``.

    Args:
        name: ``bowl``, ``funnel`` or ``latent``.
        out: the output folder.
        starts: each "R1,R2" in meters; the paper's where there are none.
        frames: of a rollout; the paper's where it is None.
        deepsdf: of latent, the network's file; the shipped chairs where it is None.
        shape: of latent, the shape to start with.

    Raises:
        InputError: there is no such task, a start is not two numbers, or latent has no such file or shape.
    """
    horizon = {} if frames is None else {"frames": frames}
    if name == "latent":
        from surfsup.design.paper.latent import latent

        if starts:
            raise InputError("--start is of bowl and funnel; a latent design starts with --shape")
        return [(out, latent(deepsdf or Path(CHAIRS), shape, **horizon))]
    if name not in VESSELS:
        raise InputError(f"there is no design '{name}'; there are {', '.join(VESSELS)} and latent")
    if deepsdf is not None or shape is not None:
        raise InputError(f"--deepsdf and --shape are of latent; '{name}' has none")
    if not starts:
        return [(out, VESSELS[name](**horizon))]
    tasks = [VESSELS[name](*radii(text), **horizon) for text in starts]
    if len(tasks) == 1:
        return [(out, tasks[0])]
    return [(out / f"start-{number}", task) for number, task in enumerate(tasks, start=1)]


def radii(text: str) -> tuple[float, float]:
    """The two radii that an option gives as "R1,R2".

    Raises:
        InputError: they are not two numbers.
    """
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--start {text}: give two radii in meters, such as --start 0.07,0.05") from None
    return first, second
