"""The commands of `semgrid-edu data`: make, fetch and check data."""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.commands.arguments import Commands

data = typer.Typer(cls=Commands, no_args_is_help=True, help="Make, fetch and check data.")
"""What `semgrid-edu` adds to its commands."""


@data.command("list")
def list_data() -> None:
    """List the data sets that can be made or fetched."""
    from semgrid_edu.workshop.simulation.datasets import RECIPES

    for name, recipe in RECIPES.items():
        frames = Counter(route.split for route in recipe.routes for _ in route.labelled)
        told = ", ".join(f"{number} labelled frames in {split!r}" for split, number in frames.items())
        typer.echo(f"{name}: simulated, {told}, classes of {recipe.label_set}; semgrid-edu data make {name} FOLDER")
    typer.echo("kitti: real drives, no labels; semgrid-edu data fetch kitti --drive 2011_09_26_0013 --folder FOLDER")
    typer.echo("pandaset: a real street with labels; semgrid-edu data fetch pandaset tells where it is")


@data.command()
def make(
    name: Annotated[str, typer.Argument(help="A simulated one of `data list`, or all.")],
    folder: Annotated[Path, typer.Argument(help="Where the data set's own folder is made.")],
    seed: Annotated[int, typer.Option(help="Seed for the drives; the same seed gives the same bytes.")] = 0,
    workers: Annotated[int, typer.Option(help="Number of processes that share the work.")] = 2,
) -> None:
    """Simulate a data set in KITTI's raw layout.

    "all" makes minikitti, minichroma and minisynthia. The same command continues after an interruption.
    """
    from semgrid_edu.workshop.simulation.datasets import DATA_SETS, make_dataset

    for one in DATA_SETS if name == "all" else [name]:
        typer.echo(f"{one} is in {make_dataset(one, folder, seed, workers)}")


@data.command()
def fetch(
    name: Annotated[str, typer.Argument(help="kitti; or pandaset, which only says where its scenes are.")],
    drive: Annotated[str, typer.Option(help="KITTI's date and number, such as 2011_09_26_0013.")] = "",
    folder: Annotated[Path, typer.Option(help="Where the day's folder and the archives go.")] = Path("kitti_raw"),
) -> None:
    """Download a drive of KITTI and its calibration, and unpack them. After an interruption, run the same command."""
    from semgrid_edu.workshop.commands.fetch import KITTI_LICENCE, PANDASET_LICENCE, fetch_kitti

    if name == "pandaset" and drive:
        raise ArgumentError("--drive", "no drive of PandaSet: its scenes aren't downloaded", drive)
    if name == "pandaset":
        typer.echo(PANDASET_LICENCE)
        return
    if name != "kitti":
        raise ArgumentError("name", "kitti or pandaset", repr(name))
    typer.echo(KITTI_LICENCE)
    fetched = fetch_kitti(folder, drive)
    typer.echo(f"{fetched.folder} holds the drive, frames: {len(fetched)}; {folder / 'archives'} may be deleted")


@data.command("from-bag")
def from_bag(
    bag: Annotated[Path, typer.Argument(help="A .bag of ROS 1, a folder of ROS 2, or an .mcap.")],
    folder: Annotated[Path, typer.Argument(help="The new folder of the drive.")],
    image: Annotated[str, typer.Option(help="Topic of rectified images, such as /camera/image_rect_color.")],
    points: Annotated[str, typer.Option(help="Topic of the LIDAR's point clouds.")],
    odometry: Annotated[str, typer.Option(help="Topic of nav_msgs/Odometry, or of poses of base_link.")],
    lidar_height: Annotated[float, typer.Option(help="Height of the LIDAR above the ground, metres.")],
    camera_info: Annotated[str | None, typer.Option(help="Calibration; else camera_info beside the images.")] = None,
    transforms: Annotated[list[str] | None, typer.Option(help="Else /tf_static; may be given again.")] = None,
) -> None:
    """Write a recording of ROS as a drive in KITTI's raw layout. Where the sensors are comes from /tf_static."""
    from semgrid_edu.workshop.bags.convert import convert_bag
    from semgrid_edu.workshop.bags.survey import Topics, info_beside

    places = tuple(transforms or ("/tf_static",))
    topics = Topics(image, points, odometry, camera_info or info_beside(image), places)
    written = convert_bag(bag, folder, topics, lidar_height)
    for why, number in written.left_out.items():
        typer.echo(f"semgrid-edu: left out: {why}: {number}", err=True)
    typer.echo(f"reflectance 1 is a brightness of {written.brightest:g}")
    typer.echo(f"{folder} holds the drive {written.date} {written.drive}, frames: {written.n_frames}")
    typer.echo(f"look at it: semgrid-edu demo {folder}")


@data.command()
def index(
    folder: Annotated[Path, typer.Argument(help="The folder of the data set; the scene itself stays where it is.")],
    pandaset: Annotated[Path, typer.Option(help="The folder that holds PandaSet's scenes.")],
    scene: Annotated[str, typer.Option(help="Number of the scene, such as 002.")] = "002",
    test: Annotated[list[str] | None, typer.Option(help="A camera to keep for testing; again for another.")] = None,
) -> None:
    """Make a data set to train with of a labelled PandaSet scene."""
    from semgrid_edu.datasets.index import write_pandaset_index

    typer.echo(f"written to {write_pandaset_index(folder, pandaset, scene, test or ())}")


@data.command()
def verify(
    folder: Annotated[Path | None, typer.Argument(help="A folder of samples; the shipped ones by default.")] = None,
) -> None:
    """Check the shipped samples against their checksums."""
    from semgrid_edu.datasets.samples import samples_problems

    report(samples_problems(folder), "every sample is as it was made")


def report(problems: list[str], success: str) -> None:
    """Print one problem per line and exit with 1, or print a message if there is none.

    Parameters
    ----------
    problems : list of str
        One line for each problem.
    success : str
        The message if there is no problem.

    Raises
    ------
    typer.Exit
        When there are problems.
    """
    if problems:
        typer.echo("\n".join(problems), err=True)
        raise typer.Exit(1)
    typer.echo(success)
