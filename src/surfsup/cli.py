"""The command line: arguments in, library calls, one clear line on an error.

Heavy imports stay inside the verbs, so that help is instant.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup import __version__
from surfsup.errors import InputError, SimulationError
from surfsup.progress import bar, paced_bar, training_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from surfsup.output import OutputFolder, Summary
    from surfsup.scene import Scene, Start

app = typer.Typer(
    name="surfsup",
    help="Pour water on any surface.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

INTERRUPTED = 130


def length(metres: float) -> float:
    """A length that an option gives.

    Raises:
        typer.BadParameter: it is not above zero or not finite.
    """
    if not 0 < metres < float("inf"):
        raise typer.BadParameter(f"{metres} is not a length in metres above 0")
    return metres


Vector = tuple[float, float, float]
Source = Annotated[Path, typer.Argument(metavar="SURFACE|SCENE.yaml", help="A mesh, or a scene file.")]
Out = Annotated[Path | None, typer.Option("-o", "--out", help="Output folder; out/NAME by default.")]
Frames = Annotated[int | None, typer.Option(min=1, help="Frames of 0.005 s; 800 by default.")]
Fit = Annotated[float, typer.Option(help="Largest extent that the mesh is scaled to, in metres.")]
NoFit = Annotated[bool, typer.Option("--no-fit", help="Take the mesh as it is, in metres.")]
Up = Annotated[str | None, typer.Option(help="The mesh's own upward axis, y or z.")]
Turn = Annotated[float, typer.Option(help="Turn the mesh by so many degrees about z.")]
At = Annotated[Vector | None, typer.Option(help="Where the mesh's foot goes, in metres.")]
BlockMin = Annotated[Vector | None, typer.Option(help="Lower corner of the block of water.")]
BlockMax = Annotated[Vector | None, typer.Option(help="Upper corner of the block of water.")]
ContainerSize = Annotated[Vector | None, typer.Option("--container", help="Sides of the container; 1 1 2.")]
NoPage = Annotated[bool, typer.Option("--no-page", help="Leave out page.html.")]
NoVideo = Annotated[bool, typer.Option("--no-video", help="Leave out video.mp4.")]
NoVideos = Annotated[bool, typer.Option("--no-video", help="Leave out the videos of the page.")]
Model = Annotated[str | None, typer.Option(help="A shipped model's name or a .safetensors file.")]
Device = Annotated[str | None, typer.Option(help="cpu or cuda; a GPU is taken where there is one.")]
Workers = Annotated[int | None, typer.Option(help="Simulations side by side on this machine; 2 by default.")]
Scheduler = Annotated[str | None, typer.Option(help="A dask scheduler whose workers do it: tcp://host:port.")]
Near = Annotated[
    float, typer.Option(callback=length, help="Metres; particles nearer to the solid count for Chamfer Surface.")
]
Seed = Annotated[int, typer.Option(min=0, help="Where random choices start.")]


@app.command()
def simulate(
    source: Source,
    out: Out = None,
    frames: Frames = None,
    fit: Fit = 0.7,
    no_fit: NoFit = False,
    up: Up = None,
    turn: Turn = 0.0,
    at: At = None,
    block_min: BlockMin = None,
    block_max: BlockMax = None,
    container: ContainerSize = None,
    model: Model = None,
    device: Device = None,
    seed: Seed = 0,
    no_guard: Annotated[bool, typer.Option("--no-guard", help="Let the network's own penetration show.")] = False,
    no_page: NoPage = False,
    no_video: NoVideo = False,
) -> None:
    """Pour water on a surface with the learned simulator.

    Example: surfsup simulate bunny.obj -o out/bunny
    """
    from surfsup.model import weights
    from surfsup.model.simulate import choose_device
    from surfsup.model.simulate import simulate as frames_of
    from surfsup.trajectory import Provenance

    simulator, card = weights.load(weights.find(model or weights.DEFAULT_MODEL))
    where = choose_device(device)
    scene = read_scene(source, frames, None if no_fit else fit, up, turn, at, block_min, block_max, container)
    if card.seen is not None and (strange := card.seen.warning(scene)) is not None:
        warnings.warn(strange, stacklevel=1)
    surface = scene.build_surface()
    start = scene.start(surface)
    folder = open_folder(out, source, scene, start, pictures=not no_video)
    with bar(f"simulating with '{card.name}'") as tell:
        summary = folder.record(
            scene,
            surface,
            start,
            frames_of(simulator, scene, surface, start, where, guarded=not no_guard),
            Provenance(card.name, seed),
            where,
            tell,
        )
    show(folder, summary, start.left_out, no_page, no_video)


@app.command()
def reference(
    source: Source,
    out: Out = None,
    frames: Frames = None,
    fit: Fit = 0.7,
    no_fit: NoFit = False,
    up: Up = None,
    turn: Turn = 0.0,
    at: At = None,
    block_min: BlockMin = None,
    block_max: BlockMax = None,
    container: ContainerSize = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the solver.")] = 1,
    no_page: NoPage = False,
    no_video: NoVideo = False,
) -> None:
    """Simulate the same scene with SPlisHSPlasH, the ground truth.

    Example: surfsup reference bunny.obj -o out/bunny-truth
    """
    from surfsup.reference import solver
    from surfsup.trajectory import Provenance

    scene = read_scene(source, frames, None if no_fit else fit, up, turn, at, block_min, block_max, container)
    surface = scene.build_surface()
    start = scene.start(surface)
    solver.require()
    folder = open_folder(out, source, scene, start, pictures=not no_video)
    with bar("simulating with SPlisHSPlasH") as tell:
        summary = folder.record(
            scene,
            surface,
            start,
            solver.simulate(scene, surface, start, threads),
            Provenance(solver.NAME),
            "cpu",
            tell,
        )
    show(folder, summary, start.left_out, no_page, no_video)


@app.command()
def generate(
    recipe: Annotated[str, typer.Argument(help="Which scenes.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the data set.")],
    n: Annotated[int, typer.Option("-n", help="How many scenes.")],
    seed: Seed = 0,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames of every scene; else as the recipe says.")] = None,
    source: Annotated[Path | None, typer.Option(help="What the recipe makes surfaces of: meshes, heights.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Make a data set with the reference solver; started again, it makes what is missing.

    Example: surfsup generate prim-shapes -o data/train -n 60 --seed 1
    """
    from surfsup.datasets.generate import generate as make

    with paced_bar(f"simulating {n} scenes of {recipe}") as tell:
        paths = make(recipe, out, n, seed, frames, source, workers, scheduler, tell)
    typer.echo(f"{len(paths)} trajectories in {out}; dataset.yaml there tells of them")


@app.command()
def floor(
    data: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the reference solver's trajectories.")],
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Run the reference three times more for each trajectory, from starts 1 mm away: how near can a model come?

    Example: surfsup floor data/test
    """
    from surfsup.datasets.floor import floor as run_again

    with paced_bar(f"running {data} again") as tell:
        made = run_again(data, workers, scheduler, tell)
    typer.echo(f"{len(made)} trajectories in {data / 'floor'}")


@app.command()
def train(
    preset: Annotated[str, typer.Argument(metavar="PRESET|CONFIG.yaml", help="What to train, and how.")],
    validation: Annotated[Path, typer.Option(help="Folder of trajectories that choose the checkpoint.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the run.")],
    data: Annotated[Path | None, typer.Option(help="Folder of training trajectories.")] = None,
    stream: Annotated[str | None, typer.Option(help="Train on new scenes of this recipe as they are made.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    overrides: Annotated[list[str] | None, typer.Argument(metavar="key=value")] = None,
    time_limit: Annotated[str, typer.Option("--time", help="Stop after so long: 90s, 30m, 2h.")] = "",
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the folder's checkpoint.")] = False,
    start: Annotated[str | None, typer.Option(help="Begin with the weights of this model or file.")] = None,
    device: Device = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch.")] = 1,
) -> None:
    """Train a learned simulator, on a folder of trajectories or on a stream of new ones.

    Example: surfsup train first --data data/train --validation data/validation -o runs/first --time 1h
    """
    from contextlib import ExitStack

    import torch

    from surfsup.datasets.streamed_windows import StreamedWindows, stream_for_training
    from surfsup.datasets.windows import Windows
    from surfsup.model import weights
    from surfsup.model.simulate import choose_device
    from surfsup.training.config import load_config, seconds_of
    from surfsup.training.devices import fabric_on
    from surfsup.training.stopping import Stop
    from surfsup.training.train import Run
    from surfsup.training.train import train as run_training

    if (data is None) == (stream is None):
        raise InputError("train on either --data DIR or --stream RECIPE")
    if data is not None and (workers or scheduler):
        raise InputError("--workers and --scheduler are for --stream, but --data needs none")
    torch.set_num_threads(threads)
    config = load_config(preset, overrides)
    stop = Stop(seconds_of(time_limit) if time_limit else float("inf"))
    run = Run(config, out, fabric_on(choose_device(device)))
    if start is not None:
        run.start_from(weights.load(weights.find(start))[0])
    if resume:
        run.resume()
    elif run.files.exist():
        raise InputError(f"{out}: holds a run already; go on with --resume or take another folder")
    with ExitStack() as stack:
        stack.enter_context(stop)
        where, number = run.fabric.device, run.fabric.global_rank
        if data is not None:
            windows = Windows(data, where)
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
    if stop.signalled:
        raise typer.Exit(INTERRUPTED)
    if not run.fabric.is_global_zero:
        return
    best = out / "best.safetensors"
    kept = f"best weights in {best}" if best.exists() else "no weights judged yet; go on with --resume"
    typer.echo(f"{run.step} of {config.last_step} steps done; {kept}")


@app.command()
def evaluate(
    model: Annotated[str, typer.Argument(help="A shipped model's name or a .safetensors file.")],
    data: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders of held-out trajectories.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder of the report; out/report-MODEL.")] = None,
    no_guard: Annotated[bool, typer.Option("--no-guard", help="Judge the network without the guard.")] = False,
    first_scenes: Annotated[
        int | None, typer.Option("--scenes", min=1, help="By so many trajectories of each folder; all by default.")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="By so many of their frames; all by default.")] = None,
    near: Near = 0.09,
    device: Device = None,
    no_video: NoVideos = False,
) -> None:
    """Judge a model on held-out trajectories of the reference solver, beside their floor where there is one.

    Example: surfsup evaluate first data/test -o out/report
    """
    from surfsup.evaluation import report
    from surfsup.evaluation.evaluate import evaluate as judge
    from surfsup.evaluation.page import write_page
    from surfsup.evaluation.table import evaluation_text
    from surfsup.evaluation.unseen import unseen
    from surfsup.evaluation.usable import data_sets, usable_truths
    from surfsup.evaluation.videos import examples, why_no_videos, write_videos
    from surfsup.model import weights
    from surfsup.model.simulate import choose_device

    simulator, card = weights.load(weights.find(model))
    where = choose_device(device)
    sets = data_sets(data, first_scenes)
    with bar("reading the truth") as tell:
        truths, skipped = usable_truths(sets, tell, frames)
    for strange in unseen(card.seen, truths).values():
        warnings.warn(strange, stacklevel=1)
    folder = out or Path("out") / f"report-{card.name}{'-no-guard' if no_guard else ''}"
    report.make_folder(folder)
    with bar(f"judging '{card.name}'") as tell:
        scenes = judge(simulator, card.name, truths, folder, where, not no_guard, near, tell)
    subject = report.Subject(card, not no_guard, near, first_scenes, frames)
    found = report.evaluation_report(subject, sets, scenes, skipped, folder)
    report.write_json(folder / "report.json", found)
    typer.echo(evaluation_text(subject, scenes, sets, skipped))
    shown, missing = ([], None) if no_video else (examples(scenes), why_no_videos())
    if missing:
        typer.echo(missing)
    write_page(folder / "report.html", found, no_videos=missing)
    if shown and not missing:  # they take minutes: whoever interrupts them still has the page
        with bar("drawing the videos") as tell:
            write_videos(folder, shown, card.name, tell)
        write_page(folder / "report.html", found, shown)
    typer.echo(f"numbers       {folder / 'report.json'}")
    typer.echo(f"trajectories  {folder / 'trajectories'}")
    typer.echo(f"page          {folder / 'report.html'}  (open it in a browser, no network needed)")


@app.command()
def compare(
    judged: Annotated[Path, typer.Argument(metavar="TRAJECTORY", help="What is judged.")],
    truth: Annotated[Path, typer.Argument(metavar="TRUTH", help="What it is judged by, of the same scene.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="A JSON file for the numbers and curves.")] = None,
    near: Near = 0.09,
) -> None:
    """Judge one trajectory by another of the same scene, beside the floor where there is one.

    Example: surfsup compare out/bunny/trajectory.h5 out/bunny-truth/trajectory.h5
    """
    from surfsup.evaluation.pair import judge_pair
    from surfsup.evaluation.report import make_folder, write_json

    with bar("comparing") as tell:
        pair = judge_pair(judged, truth, near, tell)
    typer.echo(pair.text())
    if out is not None:
        make_folder(out.parent)
        write_json(out, pair.report())
        typer.echo(f"written to {out}")


@app.command()
def view(trajectory: Annotated[Path, typer.Argument(help="A trajectory.h5.")]) -> None:
    """Write the page of a trajectory beside it.

    Example: surfsup view out/bunny/trajectory.h5
    """
    from surfsup.pictures import write_page_of

    with bar("writing the page") as tell:
        page = write_page_of(trajectory, trajectory.with_name("page.html"), tell)
    typer.echo(f"open {page} in a browser")


@app.command()
def render(
    trajectory: Annotated[Path, typer.Argument(help="A trajectory.h5.")],
    frame: Annotated[int | None, typer.Option(min=0, help="One picture of this frame instead.")] = None,
) -> None:
    """Write the video of a trajectory beside it, or a picture of one frame.

    Example: surfsup render out/bunny/trajectory.h5 --frame 120
    """
    from surfsup.pictures import write_picture_of, write_video_of
    from surfsup.viewing.graphics import require_graphics

    require_graphics()
    if frame is not None:
        made = write_picture_of(trajectory, trajectory.with_name(f"frame-{frame:05d}.png"), frame)
    else:
        with bar("drawing the video") as tell:
            made = write_video_of(trajectory, trajectory.with_name("video.mp4"), tell)
    typer.echo(f"written to {made}")


@app.command()
def doctor() -> None:
    """Tell what this machine has and lacks, and the command that mends it.

    Example: surfsup doctor
    """
    from surfsup.doctor import examine

    for finding in examine():
        typer.echo(f"{'ok     ' if finding.fine else 'missing'}  {finding.what}: {finding.found}")
        if finding.remedy:
            typer.echo(f"         mend with: {finding.remedy}")


def read_scene(
    source: Path,
    frames: int | None,
    fit: float | None,
    up: str | None,
    turn: float,
    at: Vector | None,
    block_min: Vector | None,
    block_max: Vector | None,
    container: Vector | None,
) -> Scene:
    """The scene file ``source``, or the scene of water on the mesh ``source``; says how the mesh was placed."""
    from surfsup.scene import Scene
    from surfsup.scene.pour import Placing, pour_on_mesh
    from surfsup.scene.scene import checked_block, checked_container

    if source.suffix.lower() in (".yaml", ".yml"):
        placed = up or turn or at or block_min or block_max or container
        if placed:
            raise InputError(f"{source}: a scene file places everything itself; change it there, not by options")
        scene = Scene.load(source)
        return scene if frames is None else scene.with_frames(frames)
    if (block_min is None) != (block_max is None):
        raise InputError("--block-min and --block-max go together")
    block = checked_block(block_min, block_max) if block_min and block_max else None
    placing = Placing(fit, up, turn, at or (0.0, 0.0, 0.0))
    scene, said = pour_on_mesh(source, placing, checked_container(container), block, frames or 800)
    typer.echo(said)
    return scene


def open_folder(out: Path | None, source: Path, scene: Scene, start: Start, pictures: bool) -> OutputFolder:
    """The output folder, once it is known that what was asked for can be made here."""
    from surfsup.output import OutputFolder
    from surfsup.viewing.graphics import require_graphics

    if pictures:
        require_graphics()
    return OutputFolder(out or Path("out") / source.stem, len(start.positions), scene.frames)


def show(folder: OutputFolder, summary: Summary, left_out: int, no_page: bool, no_video: bool) -> None:
    """Make page and video, and say what was made, how fast, and how to look at it."""
    from surfsup.pictures import write_page_of, write_video_of

    if not no_page:
        with bar("writing the page") as tell:
            write_page_of(folder.trajectory, folder.page, tell)
    if not no_video:
        with bar("drawing the video") as tell:
            write_video_of(folder.trajectory, folder.video, tell)
    if left_out:
        typer.echo(f"{left_out} particles would have started in the solid and were left out")
    typer.echo(
        f"{summary.particles} particles, {summary.frames} frames in {summary.seconds:.1f} s "
        f"({summary.ms_per_frame:.1f} ms a frame); {summary.penetrations} in the solid, "
        f"{summary.out_of_container} out of the container"
    )
    typer.echo(f"trajectory  {folder.trajectory}")
    if not no_page:
        typer.echo(f"page        {folder.page}  (open it in a browser, no network needed)")
    if not no_video:
        typer.echo(f"video       {folder.video}")


@app.callback(invoke_without_command=True)
def surfsup(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Pour water on any surface."""
    if version:
        typer.echo(__version__)
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


def one_line_warnings() -> Callable[..., None]:
    """How warnings are shown to a user: one line each, and each once."""
    told: set[str] = set()

    def show_warning(message: Warning | str, *_: object) -> None:
        if str(message) not in told:
            told.add(str(message))
            sys.stderr.write(f"surfsup: warning: {message}\n")

    return show_warning


def main() -> None:
    """Run the command line; exit with 0, 2 for bad input, 1 for a fault of ours, 130 when interrupted."""
    warnings.showwarning = one_line_warnings()
    try:
        status = app(standalone_mode=False)
    except (InputError, typer.TyperException) as error:
        message = error.format_message() if isinstance(error, typer.TyperException) else str(error)
        sys.stderr.write(f"surfsup: {message}\n")
        sys.exit(2)
    except SimulationError as error:
        sys.stderr.write(f"surfsup: {error}\n")
        sys.exit(1)
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    if status == INTERRUPTED:
        sys.stderr.write("surfsup: interrupted; what was finished is kept\n")
    sys.exit(status if isinstance(status, int) else 0)


if __name__ == "__main__":
    main()
