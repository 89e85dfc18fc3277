"""The shipped samples: a short simulated drive, a few labelled frames and trained compact weights."""

from pathlib import Path

from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.errors import DataError
from semgrid_edu.provenance import FILE_NAME, provenance_problems


def samples_dir() -> Path:
    """Return the folder `data_samples` of the clone that this package runs from, or of the current folder.

    Raises
    ------
    DataError
        When there is none: an installed wheel holds the package alone.
    """
    beside_the_package = Path(__file__).resolve().parents[2] / "data_samples"
    for folder in (beside_the_package, Path.cwd() / "data_samples"):
        if folder.is_dir():
            return folder
    raise DataError(
        Path.cwd() / "data_samples",
        "the shipped samples (run inside a clone of the project, or make a drive with `semgrid-edu data make`)",
        "no such folder",
    )


def sample_drive() -> KittiRawDrive:
    """Return the shipped drive: 20 labelled frames of a simulated street."""
    return KittiRawDrive(samples_dir() / "drive", "2026_01_01", "0001")


def sample_weights() -> Path:
    """Return the file of the trained compact network, SegNet and fusion."""
    return samples_dir() / "weights" / "segnet_compact.safetensors"


def samples_problems(folder: Path | None = None) -> list[str]:
    """Check every sample against its provenance file.

    Parameters
    ----------
    folder : Path, optional
        A folder of samples, each a folder with a `provenance.json`; the shipped ones by default.

    Returns
    -------
    list of str
        One line for each file that is missing, changed or not recorded.

    Raises
    ------
    DataError
        When there is no such folder, or it holds no samples, or one has no provenance file.
    """
    folder = samples_dir() if folder is None else folder
    samples = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    if not samples:
        raise DataError(folder, f"folders of samples, each with a {FILE_NAME}", "none")
    return [problem for sample in samples for problem in provenance_problems(sample)]
