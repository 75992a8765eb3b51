"""`surfsup train`: learned simulators from trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Device, Scheduler, Workers
from surfsup.cli.progress import training_line
from surfsup.cli.status import INTERRUPTED
from surfsup.errors import InputError


def train(
    preset: Annotated[str, typer.Argument(metavar="PRESET|CONFIG.yaml", help="What to train, and how.")],
    validation: Annotated[Path, typer.Option(help="Folder of trajectories that choose the checkpoint.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the run.")],
    data: Annotated[list[Path] | None, typer.Option(help="Folder of training trajectories; may be repeated.")] = None,
    stream: Annotated[str | None, typer.Option(help="Train on new scenes of this recipe as they are made.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    overrides: Annotated[list[str] | None, typer.Argument(metavar="key=value")] = None,
    time_limit: Annotated[str, typer.Option("--time", help="Stop after so long: 90s, 30m, 2h.")] = "",
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the folder's checkpoint.")] = False,
    start: Annotated[str | None, typer.Option(help="Begin with the weights of this model, file or run.")] = None,
    device: Device = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch.")] = 1,
) -> None:
    """Train a learned simulator, on a folder of trajectories or on a stream of new ones.

    Example: surfsup train fast --data data/train --validation data/validation -o runs/fast --time 1h
    """
    from contextlib import ExitStack

    import torch

    from surfsup.datasets.streaming.streamed_windows import StreamedWindows, stream_for_training
    from surfsup.datasets.windows import Windows
    from surfsup.learned import weights_file
    from surfsup.optim.stopping import Stop
    from surfsup.simulation import choose_device
    from surfsup.training.config import load_config, seconds_of
    from surfsup.training.devices import fabric_on, leave_together
    from surfsup.training.train import Run
    from surfsup.training.train import train as run_training

    if bool(data) == (stream is not None):
        raise InputError("train on either --data DIR or --stream RECIPE")
    if data and (workers or scheduler):
        raise InputError("--workers and --scheduler are for --stream, but --data needs none")
    torch.set_num_threads(threads)
    config = load_config(preset, overrides)
    stop = Stop(seconds_of(time_limit) if time_limit else float("inf"))
    run = Run(config, out, fabric_on(choose_device(device)))
    if start is not None:
        simulator = (
            Run.average_of(Path(start)) if Path(start).is_dir() else weights_file.load(weights_file.find(start))[0]
        )
        run.start_from(simulator)
    if resume:
        run.resume()
    elif run.files.exist():
        raise InputError(f"{out}: holds a run already; go on with --resume or take another folder")
    with ExitStack() as stack:
        stack.enter_context(stop)
        where, number = run.fabric.device, run.fabric.global_rank
        if data:
            windows = Windows(*data, device=where)
        else:
            folder = out / f"process-{number}" if number else out
            entropy = [config.seed, run.step, number]
            coming = stack.enter_context(stream_for_training(stream, folder, entropy, workers, scheduler))
            windows = StreamedWindows(coming, device=where)
        tell = log = None
        if run.fabric.is_global_zero:
            from surfsup.training.tensorboard import log_of

            tell, log = stack.enter_context(training_line()), stack.enter_context(log_of(run, validation))
        run_training(run, windows, validation, stop, tell, log)
    leave_together(run.fabric)
    if stop.signaled:
        raise typer.Exit(INTERRUPTED)
    if not run.fabric.is_global_zero:
        return
    best = out / "best.safetensors"
    kept = f"best weights in {best}" if best.exists() else "no weights judged yet; go on with --resume"
    typer.echo(f"{run.step} of {config.last_step} steps done; {kept}")
