"""The tasks that the options of `surfsup design` select, each with its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from surfsup.design.paper.bowl import bowl
from surfsup.design.paper.funnel import funnel
from surfsup.design.task import Task
from surfsup.errors import InputError

CHAIRS = "chairs"  # the shipped DeepSDF of chairs
VESSELS: dict[str, Callable[..., Task]] = {"bowl": bowl, "funnel": funnel}


def tasks_from_options(
    name: str,
    out: Path,
    starts: list[str] | None,
    frames: int | None,
    deepsdf: Path | None = None,
    shape: str | None = None,
) -> list[tuple[Path, Task]]:
    """One task for each start; several starts each get their own folder in ``out``.

    Args:
        name: ``bowl``, ``funnel`` or ``latent``.
        out: output folder.
        starts: initial radii "R1,R2" in meters; None for the paper's.
        frames: of a rollout; None for the paper's.
        deepsdf: file of the network, for ``latent``; None for the shipped chairs.
        shape: initial shape, for ``latent``.

    Raises:
        InputError: there is no such task, a start is not two numbers, or there is no such file or shape.
    """
    length = {} if frames is None else {"frames": frames}
    if name == "latent":
        from surfsup.design.paper.latent import latent

        if starts:
            raise InputError("--start is for bowl and funnel; a latent design starts with --shape")
        return [(out, latent(deepsdf or Path(CHAIRS), shape, **length))]
    if name not in VESSELS:
        raise InputError(f"there is no design '{name}'; there are {', '.join(VESSELS)} and latent")
    if deepsdf is not None or shape is not None:
        raise InputError(f"--deepsdf and --shape are for latent, not for '{name}'")
    if not starts:
        return [(out, VESSELS[name](**length))]
    tasks = [VESSELS[name](*parse_radii(text), **length) for text in starts]
    if len(tasks) == 1:
        return [(out, tasks[0])]
    return [(out / f"start-{number}", task) for number, task in enumerate(tasks, start=1)]


def parse_radii(text: str) -> tuple[float, float]:
    """The two radii of "R1,R2".

    Raises:
        InputError: they are not two numbers.
    """
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--start {text}: give two radii in meters, such as --start 0.07,0.05") from None
    return first, second
