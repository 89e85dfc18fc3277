"""The command line, `semgrid-edu`: parses and calls, nothing else."""

import os
import signal
import sys
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperCommand

from semgrid_edu import __version__
from semgrid_edu.errors import ArgumentError, DataError, MissingExtraError
from semgrid_edu.fast.numba_cache import keep_compiled_functions
from semgrid_edu.storage.files import CACHE_VARIABLE
from semgrid_edu.workshop.commands.arguments import Commands, as_typed, check_arguments, dataset_doubts, drive_in, tell
from semgrid_edu.workshop.commands.course import course
from semgrid_edu.workshop.commands.data import data
from semgrid_edu.workshop.commands.experiments import reproduce

app = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None)
Resume = Annotated[bool, typer.Option("--resume", help="Go on with a run that was interrupted, if there is one.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that this command hasn't written, too.")]

PICTURES = (".png", ".pdf", ".svg")
"""Formats of pictures whose metadata can hold the command."""

app.add_typer(data, name="data")
app.add_typer(course, name="course")
app.add_typer(reproduce, name="reproduce")


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"semgrid_edu {__version__}")
        raise typer.Exit


@app.callback()
def main(
    cache: Annotated[Path | None, typer.Option(help="Where preprocessed data are kept.")] = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Probabilistic bird's-eye semantic perception, taught notebook by notebook.

    Without --cache each data set keeps its preprocessed data itself, so it can't be read-only.
    """
    if cache is not None:
        os.environ[CACHE_VARIABLE] = str(cache.resolve())


@app.command()
def demo(
    path: Annotated[Path | None, typer.Argument(help="The folder of a drive, or one above it.")] = None,
    reader: Annotated[Path | None, typer.Option(help="A Python file with a class that reads PATH.")] = None,
    camera: Annotated[
        str | None,
        typer.Option(help="KITTI: image_02 (default) or image_03. PandaSet: front_camera (default), left_camera ..."),
    ] = None,
    weights: Annotated[Path | None, typer.Option(help="A trained network; else a shipped SegNet.")] = None,
    frames: Annotated[str | None, typer.Option(help="FIRST:LAST[:STEP], LAST excluded, such as 40:120:2.")] = None,
    stages: Annotated[Path | None, typer.Option(help="A Python file with stages of your own, to compare.")] = None,
    memory: Annotated[
        bool, typer.Option("--memory", help="Remember classes over frames, and show that map too.")
    ] = False,
    skip_damaged: Annotated[
        bool, typer.Option("--skip-damaged", help="Leave out frames with a damaged file, and say which.")
    ] = False,
    out: Annotated[Path, typer.Option(help="The folder for the page.")] = Path("out/demo"),
    save: Annotated[
        Path | None, typer.Option(help="A new folder for arrays, maps of the drive and an animation.")
    ] = None,
    rerun: Annotated[
        Path | None, typer.Option(help="An .rrd file for the Rerun viewer, which the extra rerun installs.")
    ] = None,
    force: Force = False,
    show: Annotated[bool, typer.Option("--open", help="Show the page in a browser.")] = False,
) -> None:
    """Run every stage over a drive, and write a page that shows it.

    PATH is a drive of KITTI raw, KITTI tracking, SemanticKITTI or PandaSet, or a recording that a class in --reader
    reads. Without PATH the two shipped drives are shown: a real street, and in the folder simulated/ a simulated one.
    Without --frames all frames are run. A file for --stages defines some of track, segment, sample, fuse, refine and
    remember.
    """
    from semgrid_edu.networks.weights import weights_doubts
    from semgrid_edu.workshop.demo import write_both_streets, write_demo
    from semgrid_edu.workshop.doubts import drive_doubts

    chosen = drive_in(path, reader, camera)
    tell([*(drive_doubts(chosen) if chosen else ()), *(weights_doubts(weights) if weights else ())])
    options = {"stages": stages, "frames": frames, "force": force, "memory": memory}
    options |= {"save": save, "rerun": rerun}
    if skip_damaged:
        options["skipped"] = lambda line: typer.echo(f"semgrid-edu: left out: {line}", err=True)
    if chosen is None:
        page = write_both_streets(out, weights, **options)
    else:
        page = write_demo(chosen, weights, out, **options)
    typer.echo(f"open {page.resolve().as_uri()}\nin one picture: {page.parent / 'overview.png'}")
    for written in filter(None, (save, rerun)):
        typer.echo(f"written to {written}")
    if show:
        typer.launch(page.resolve().as_uri())


class _TrainCommand(TyperCommand):
    """A command whose help names every image network: looked up when the help is shown, since that loads PyTorch."""

    def format_help(self, ctx, formatter) -> None:
        """Write the help."""
        from semgrid_edu.networks import SEGMENTERS

        (segmenter,) = (option for option in self.params if option.name == "segmenter")
        segmenter.help = f"The image network: {', '.join(SEGMENTERS)}."
        super().format_help(ctx, formatter)


@app.command(cls=_TrainCommand)
def train(
    data: Annotated[list[Path], typer.Option(help="A data set with train frames; several take turns.")],
    out: Annotated[Path, typer.Option(help="A folder for the weights, the log and their provenance.")],
    segmenter: Annotated[str, typer.Option(help="The image network.")] = "segnet",
    preset: Annotated[str, typer.Option(help="compact or paper (published size, 0.2 m cells).")] = "compact",
    heights: Annotated[bool, typer.Option("--return-heights", help="Let the fusion see return heights.")] = False,
    image_size: Annotated[str | None, typer.Option(help="Height x width of the images, such as 192x640.")] = None,
    imagenet: Annotated[
        str | None, typer.Option(help="ImageNet weights to start from: a file; for efficientnet `installed`.")
    ] = None,
    start: Annotated[
        list[Path] | None, typer.Option("--from", help="A trained network to start from; again: their mean.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed for the initial weights and the order of the frames.")] = 0,
    iterations: Annotated[int, typer.Option(min=1, help="Steps of each of the two stages.")] = 2000,
    tint: Annotated[float, typer.Option(help="How far each colour of an image varies: 0.15 is 15 % either way.")] = 0.0,
    two_stage: Annotated[bool, typer.Option("--two-stage", help="Train the fusion on a fixed image network.")] = False,
    truth: Annotated[str, typer.Option(help="true, lidar, or another way, such as no-cleanup.")] = "true",
    gaps: Annotated[bool, typer.Option("--fill-gaps", help="Learn cells far from labels as unknown.")] = False,
    half: Annotated[bool, typer.Option("--half", help="Write convolutions in 16 bits, in half the space.")] = False,
    resume: Resume = False,
    device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu, cuda or cuda:N.")] = "auto",
) -> None:
    """Train a network: first its image network, then all of it.

    torchrun runs it in several processes. ImageNet weights are a safetensors file (VGG16 or ResNet-101, for
    --preset paper), or those that the extra imagenet installs (EfficientNet-Lite0, for both presets). --truth lidar
    makes labels from image labels and LIDAR, with the errors of real data; other ways of making them, such as
    no-cleanup, have names of their own.
    """
    from semgrid_edu.networks.weights import weights_doubts
    from semgrid_edu.workshop.training_run import chosen_size, chosen_truth, train_network, training_params

    kind = {"preset": preset, "uses_return_heights": heights, "image_size": chosen_size(image_size)}
    params = training_params(preset, iterations, not two_stage, from_imagenet=imagenet is not None, tint=tint)
    tell([line for folder in data for line in dataset_doubts(folder, "train")])
    for path in start or ():
        tell(weights_doubts(path))
    choices = kind | {"imagenet": imagenet, "device": device, "truth": chosen_truth(truth), "fill_gaps": gaps}
    train_network(data, out, segmenter, params, seed, resume, start=start or (), half=half, **choices)


@app.command()
def curves(
    runs: Annotated[list[Path], typer.Argument(help="Folders that `semgrid-edu train` writes, finished or not.")],
    out: Annotated[Path, typer.Option(help="Where to write the picture: a .png, .pdf or .svg.")] = Path("curves.png"),
    force: Force = False,
) -> None:
    """Draw the loss of one or several training runs over their steps."""
    from semgrid_edu.plotting import training_curves
    from semgrid_edu.storage.files import atomic_path, check_ours
    from semgrid_edu.training.log import LOG, read_log

    if out.suffix not in PICTURES:
        raise ArgumentError("--out", f"a picture that ends in one of {', '.join(PICTURES)}", out)
    check_ours(Commands.asked, out, force=force)
    names = [run.resolve().name for run in runs]
    if len(set(names)) < len(names):
        names = list(map(str, runs))
    axes = training_curves({name: read_log(run / LOG) for name, run in zip(names, runs, strict=True)})
    with atomic_path(out) as path:
        axes.figure.savefig(path, dpi=150, metadata={"Creator": Commands.asked})
    typer.echo(f"written to {out}")


@app.command()
def evaluate(
    data: Annotated[Path, typer.Option(help="A data set with train and test frames, such as data/minikitti.")],
    weights: Annotated[Path, typer.Option(help="A network trained on its train frames.")],
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("evaluation.json"),
    confusions: Annotated[Path | None, typer.Option(help="Takes each frame's confusion matrices, as .npz.")] = None,
    force: Force = False,
) -> None:
    """Score a trained network and the baselines on the test frames."""
    from semgrid_edu.networks.weights import weights_doubts
    from semgrid_edu.storage.files import check_ours, write_json
    from semgrid_edu.workshop.scoring.confusions import confusion_key, distance_band_names
    from semgrid_edu.workshop.scoring.evaluate import evaluate, scores_table

    if confusions and confusions.suffix != ".npz":
        raise ArgumentError("--confusions", "a file that ends in .npz", confusions)
    if confusions:
        if confusions.resolve() == out.resolve():
            raise ArgumentError("--confusions", "another file than --out", confusions)
        check_ours(confusion_key("network", "true", distance_band_names()[0]), confusions, force=force)
    check_ours(f'"command": "{Commands.asked} ', out, force=force)
    tell(dataset_doubts(data, "train", "test") + weights_doubts(weights))
    result = evaluate(data, weights, confusions_file=confusions)
    write_json(out, result)
    typer.echo(f"{scores_table(result['scores'], result['intervals'])}\n\nwritten to {out}")


def run() -> None:
    """Run the command line; a mistake in the input, or a failing disk, ends in one line, not in a traceback."""
    # Idle OpenMP threads spin, which keeps busy cores from the threads that have work: on two busy cores a frame took
    # 1.2 s instead of 0.07 s. OpenMP reads this once, when a command loads torch or numba, so it must be set before.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    if "RANK" not in os.environ:  # torchrun ends its processes by this signal, and waits for them
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        check_arguments(sys.argv[1:])
        if told := keep_compiled_functions():
            typer.echo(f"semgrid-edu: {told}", err=True)
        app(prog_name="semgrid-edu")
    except (ArgumentError, DataError, MissingExtraError, OSError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "Symlink loop" not in str(error):
            raise
        if isinstance(error, ArgumentError):
            error = as_typed(error)
        where = f"{error.filename}: " if getattr(error, "filename", None) else ""
        sys.exit(f"semgrid-edu: {where}{getattr(error, 'strerror', None) or error}")
