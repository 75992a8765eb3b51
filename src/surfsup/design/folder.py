"""The folder of a design run: the checkpoint that it goes on from, and what whoever reads finds there."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import torch
from torch import Tensor

from surfsup.design.run import DesignRun
from surfsup.errors import InputError
from surfsup.optim.checkpoint import Checkpoint, without_prefix


def save(run: DesignRun) -> None:
    """Write all that the run needs to go on, and ``design.json`` and ``history.csv``.

    Raises:
        InputError: the disk is full or not writable.
    """
    ascent, tensors = run.ascent, {}
    tensors |= {f"values.{name}": value.detach() for name, value in ascent.values.items()}
    tensors |= {f"ascent.{name}": value for name, value in ascent.memory.items()}
    tensors |= {f"trust.{name}": value for name, value in run.trust.memory.items()}
    for name in run.start:
        tensors[f"designs.{name}"] = torch.stack([design[name] for design in run.designs])
    tensors["rewards"] = torch.tensor(run.rewards, dtype=torch.float64)
    tensors["lengths"] = torch.tensor(ascent.lengths, dtype=torch.float64)
    tensors["found_after"] = torch.tensor(run.found_after)
    counters = {
        "iteration": ascent.iteration,
        "cut": ascent.cut,
        "doubted": int(run.trust.doubted),
        "broken": run.trust.broken,
        "still": run.trust.still,
        "simulations": run.simulations,
        "seconds": run.seconds,
        "work": run.work,
    }
    run.files.save(Checkpoint(tensors, counters, json.dumps(run.config)))
    write_whole(run.folder / "design.json", json.dumps(summary(run), indent=2) + "\n")
    write_whole(run.folder / "history.csv", history(run))


def resume(run: DesignRun) -> None:
    """Go on from the checkpoint in the run's folder.

    Raises:
        InputError: there is none, it is cut off, or it belongs to another design.
    """
    checkpoint, file = run.files.load(), run.files.last
    if checkpoint.config != json.dumps(run.config):
        raise InputError(f"{file}: belongs to a design with other settings; give the same as before, or a new folder")
    try:
        tensors, counters, ascent = checkpoint.tensors, checkpoint.counters, run.ascent
        values = without_prefix("values.", tensors)
        ascent.values = {name: values[name].requires_grad_() for name in run.start}
        ascent.memory = {name: tensors[f"ascent.{name}"] for name in ascent.memory}
        run.trust.memory = without_prefix("trust.", tensors)
        run.trust.doubted, run.trust.broken = bool(counters["doubted"]), counters["broken"]
        run.trust.still = counters["still"]
        ascent.iteration, ascent.cut = counters["iteration"], counters["cut"]
        ascent.lengths, run.rewards = tensors["lengths"].tolist(), tensors["rewards"].tolist()
        run.found_after, run.simulations = tensors["found_after"].tolist(), counters["simulations"]
        columns = without_prefix("designs.", tensors)
        run.designs = [{name: columns[name][number] for name in run.start} for number in range(len(run.rewards))]
        run.seconds, run.work = counters["seconds"], counters["work"]
    except (KeyError, IndexError) as error:
        raise InputError(f"{file}: is no checkpoint of this version ({error})") from None


def summary(run: DesignRun) -> dict[str, object]:
    """What ``design.json`` tells: the settings, and start, best and last design."""
    told = (("start", 0), ("best", run.best), ("last", len(run.designs) - 1))
    return {
        **run.config,
        "iterations_done": run.ascent.iteration,
        "simulations": run.simulations,
        "settled": run.settled,
        "seconds": round(run.seconds, 1),
        "processor_seconds": round(run.work, 1),
        "gradients_cut": run.ascent.cut,
        "designs": {
            label: {
                "iteration": number,
                "reward": run.rewards[number],
                **{name: value.tolist() for name, value in run.designs[number].items()},
            }
            for label, number in told
        },
    }


def history(run: DesignRun) -> str:
    """What ``history.csv`` tells: a row for each design looked at."""
    text = io.StringIO()
    rows = csv.writer(text)
    names = [f"{name}{part}" for name, value in run.start.items() for part in parts_of(value)]
    rows.writerow(["iteration", "reward", *names])
    for number, (reward, design) in enumerate(zip(run.rewards, run.designs, strict=True)):
        flat = torch.cat([value.flatten() for value in design.values()])
        rows.writerow([number, f"{reward:.7g}", *(f"{value:.7g}" for value in flat.tolist())])
    return text.getvalue()


def parts_of(value: Tensor) -> list[str]:
    """What comes behind a parameter's name to tell its numbers apart."""
    return [""] if value.ndim == 0 else [f".{number}" for number in range(value.numel())]


def write_whole(path: Path, text: str) -> None:
    """Write ``text`` to ``path``, which appears under its name only when it is whole."""
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(text, encoding="utf-8", newline="")
    partial.replace(path)
