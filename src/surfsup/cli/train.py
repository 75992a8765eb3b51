"""`surfsup train`: train a learned simulator on trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.locks import hold_lock
from surfsup.cli.options import Device, Overrides, Resume, Scheduler, Threads, TimeLimit, Workers, stop_after
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import RESUMABLE
from surfsup.errors import InputError, Interrupted, did_you_mean
from surfsup.io.trajectory_path import trajectory_files

if TYPE_CHECKING:
    from surfsup.datasets.windows import WindowSource
    from surfsup.training.run import TrainingRun


PRESET_NAMES = (
    "surfsup",
    "gns",
    "value-only",
    "no-sdf",
    "corrected",
    "paper-recipe",
    "decay",
)  # a test compares the files


def train(
    preset: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|CONFIG.yaml",
            help=f"The training configuration: {', '.join(PRESET_NAMES)}, or a file of your own.",
        ),
    ],
    validation: Annotated[Path, typer.Option(help="Folder of trajectories that choose the best weights.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the run.")],
    data: Annotated[list[Path] | None, typer.Option(help="Folder of training trajectories; repeatable.")] = None,
    stream: Annotated[str | None, typer.Option(help="Train on new scenes of this recipe.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    overrides: Overrides = None,
    time_limit: TimeLimit = "",
    resume: Resume = False,
    start: Annotated[str | None, typer.Option(help="Start from these weights: a name, a file, or a run.")] = None,
    device: Device = None,
    threads: Threads = 1,
) -> None:
    """Train a learned simulator.

    It learns from folders of trajectories, or from a stream of new ones. The first weights of surfsup come after 5,000
    steps, some 15 minutes of a quiet core; useful ones take hours (docs/training.md, "How long").

    Example: surfsup train surfsup --data data/train --validation data/validation -o runs/surfsup --time 1h
    """
    if preset not in PRESET_NAMES and not Path(preset).is_file():
        hint = did_you_mean(preset, PRESET_NAMES)
        raise InputError(f"there is no training preset or file '{preset}'{hint}; presets are {', '.join(PRESET_NAMES)}")
    if bool(data) == (stream is not None):
        raise InputError("train on either --data DIR or --stream RECIPE")
    for folder in (*(data or []), validation):
        if not folder.exists():
            trajectory_files(folder)
    from contextlib import ExitStack

    import torch

    from surfsup.datasets.streaming.streamed_windows import StreamedWindows, stream_for_training
    from surfsup.datasets.windows import Windows
    from surfsup.learned import weights_file
    from surfsup.sph.device import choose_device
    from surfsup.training.config import load_config
    from surfsup.training.devices import fabric_on, shut_down
    from surfsup.training.run import TrainingRun, load_average
    from surfsup.training.tensorboard import open_log
    from surfsup.training.train import train as run_training

    if data and (workers or scheduler):
        raise InputError("--workers and --scheduler apply to --stream only")
    torch.set_num_threads(threads)
    config = load_config(preset, overrides or [])
    stop = stop_after(time_limit)
    run = TrainingRun(config, out, fabric_on(choose_device(device)))
    if start is not None:
        is_run = Path(start).is_dir()
        run.start_from(load_average(Path(start)) if is_run else weights_file.load(weights_file.find(start))[0])
    if run.is_main_process:
        hold_lock(out)
    if resume:
        run.resume()
    elif run.files.exist():
        raise InputError(f"{out}: contains a run; add --resume or choose another folder")
    with ExitStack() as stack:
        stack.enter_context(stop)
        windows: WindowSource
        if stream is None:
            windows = Windows(*(data or []), device=run.fabric.device)
        else:
            rank = run.fabric.global_rank
            folder = out / f"process-{rank}" if rank else out
            entropy = [config.seed, run.step, rank]
            simulations = stack.enter_context(stream_for_training(stream, folder, entropy, workers, scheduler))
            windows = StreamedWindows(simulations, device=run.fabric.device)
        report = log = None
        if run.is_main_process:
            report = stack.enter_context(progress_bar("training", stop)).report
            log = stack.enter_context(open_log(run, validation))
        run_training(run, windows, validation, stop, report, log)
    shut_down(run.fabric)
    if stop.signaled:
        raise Interrupted(RESUMABLE)
    if not run.is_main_process:
        return
    typer.echo(f"{run.step} of {config.steps} steps done; {result_of(run)}")


def result_of(run: TrainingRun) -> str:
    """Where the weights are, or when there will be some."""
    best = run.folder / "best.safetensors"
    if best.exists():
        return f"best weights in {best}"
    every = min(run.config.validate_every, run.config.steps)
    when = f" (at this rate after {duration(every * run.seconds / run.step)})" if run.step else ""
    return (
        f"too few for weights, which the first validation after {every} steps writes{when}; "
        f"continue with --resume and more --time"
    )


def duration(seconds: float) -> str:
    """A time in a unit that suits it.

    Examples:
        >>> duration(50), duration(950), duration(9000)
        ('50 s', '16 minutes', '2.5 hours')
    """
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} minutes" if seconds < 7200 else f"{seconds / 3600:.1f} hours"
