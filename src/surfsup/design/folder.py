"""The folder of a design run: its checkpoint, and files for the user."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import torch
from torch import Tensor

from surfsup.design.run import DesignRun
from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file
from surfsup.optim.checkpoint import Checkpoint, with_prefix, without_prefix


def save(run: DesignRun) -> None:
    """Write the checkpoint of the run, ``design.json`` and ``history.csv``.

    Raises:
        InputError: the disk is full or not writable.
    """
    optimizer, check = run.optimizer, run.gradient_check
    tensors = {
        **with_prefix("values.", {name: value.detach() for name, value in optimizer.values.items()}),
        **with_prefix("optimizer.", optimizer.state),
        **with_prefix("gradient_check.", check.previous),
        **{f"designs.{name}": torch.stack([design[name] for design in run.designs]) for name in run.start},
        "rewards": torch.tensor(run.rewards, dtype=torch.float64),
        "gradient_norms": torch.tensor(optimizer.gradient_norms, dtype=torch.float64),
        "simulations_at": torch.tensor(run.simulations_at),
    }
    counters = {
        "step": optimizer.iteration,
        "clipped": optimizer.clipped,
        "unreliable": check.unreliable,
        "failures": check.failures,
        "stalls": check.stalls,
        "simulations": run.simulations,
        "wall_seconds": run.wall_seconds,
        "cpu_seconds": run.cpu_seconds,
    }
    run.files.save(Checkpoint(tensors, counters, json.dumps(run.config)))
    write_text(run.folder / "design.json", json.dumps(summary(run), indent=2) + "\n")
    write_text(run.folder / "history.csv", history_table(run))


def resume(run: DesignRun) -> None:
    """Continue from the checkpoint in the run's folder.

    Raises:
        InputError: there is none, it is damaged, or it belongs to another design.
    """
    checkpoint, file = run.files.load(), run.files.last
    if checkpoint.config != json.dumps(run.config):
        raise InputError(f"{file}: belongs to a design with other settings; use the same settings, or a new folder")
    try:
        tensors, counters, optimizer, check = checkpoint.tensors, checkpoint.counters, run.optimizer, run.gradient_check
        values = without_prefix("values.", tensors)
        optimizer.values = {name: values[name].requires_grad_() for name in run.start}
        optimizer.state = {name: tensors[f"optimizer.{name}"] for name in optimizer.state}
        optimizer.iteration, optimizer.clipped = counters["step"], counters["clipped"]
        optimizer.gradient_norms = tensors["gradient_norms"].tolist()
        check.previous = without_prefix("gradient_check.", tensors)
        check.unreliable, check.failures = counters["unreliable"], counters["failures"]
        check.stalls = counters["stalls"]
        run.rewards, run.simulations_at = tensors["rewards"].tolist(), tensors["simulations_at"].tolist()
        designs = without_prefix("designs.", tensors)
        run.designs = [{name: designs[name][number] for name in run.start} for number in range(len(run.rewards))]
        run.simulations = counters["simulations"]
        run.wall_seconds, run.cpu_seconds = counters["wall_seconds"], counters["cpu_seconds"]
    except (KeyError, IndexError) as error:
        raise InputError(f"{file}: is no design checkpoint of this version ({error})") from None


def summary(run: DesignRun) -> dict[str, object]:
    """The content of ``design.json``: the settings, and the first, the best and the last design."""
    labels = (("start", 0), ("best", run.best), ("last", len(run.designs) - 1))
    return {
        **run.config,
        "iterations_done": run.optimizer.iteration,
        "simulations": run.simulations,
        "converged": run.converged,
        "wall_seconds": round(run.wall_seconds, 1),
        "cpu_seconds": round(run.cpu_seconds, 1),
        "gradients_clipped": run.optimizer.clipped,
        "designs": {
            label: {
                "iteration": number,
                "reward": run.rewards[number],
                **{name: value.tolist() for name, value in run.designs[number].items()},
            }
            for label, number in labels
        },
    }


def history_table(run: DesignRun) -> str:
    """The content of ``history.csv``: one row for each design."""
    text = io.StringIO()
    rows = csv.writer(text)
    names = [f"{name}{suffix}" for name, value in run.start.items() for suffix in element_suffixes(value)]
    rows.writerow(["iteration", "reward", *names])
    for number, (reward, design) in enumerate(zip(run.rewards, run.designs, strict=True)):
        elements = torch.cat([value.flatten() for value in design.values()])
        rows.writerow([number, f"{reward:.7g}", *(f"{element:.7g}" for element in elements.tolist())])
    return text.getvalue()


def element_suffixes(value: Tensor) -> list[str]:
    """A suffix for each element of a parameter; an empty one for a scalar."""
    return [""] if value.ndim == 0 else [f".{number}" for number in range(value.numel())]


def write_text(path: Path, text: str) -> None:
    """Write ``text`` to ``path``; the file appears once it is complete."""
    with atomic_file(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="")
