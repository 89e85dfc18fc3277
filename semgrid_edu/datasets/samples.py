"""The shipped samples: a simulated drive and a real one, a few labelled frames and trained weights (section 4).

Modules that need torch are imported where they are used, because torch takes seconds and reading the drive doesn't need
it.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.pandaset_files import CREDIT
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import shipped_folder
from semgrid_edu.storage.provenance import PROVENANCE, provenance_problems

if TYPE_CHECKING:
    from semgrid_edu.datasets.training_set import Sample


def samples_dir() -> Path:
    """Return the folder of the samples. A wheel has the drives and the networks of the demo, a clone all samples."""
    return shipped_folder("data_samples")


def sample_drive() -> KittiRawDrive:
    """Return the shipped drive: 20 labelled frames of a simulated street."""
    return KittiRawDrive(samples_dir() / "sample", "2026_01_01", "0001")


def real_drive() -> KittiRawDrive:
    """Return the shipped real drive: ten frames of a street, from PandaSet (its README.md names licence and terms)."""
    drive = KittiRawDrive(samples_dir() / "real", "2019_05_11", "0002")
    drive.credit = CREDIT
    return drive


def real_weights() -> Path:
    """Return the weights that real drives use by default; `card.json` beside them describes them."""
    return samples_dir() / "efficientnet_real" / "weights.safetensors"


def segnet_real_weights() -> Path:
    """Return the weights of the paper's system that learned from the shipped street, for lectures 00, 10 and 14."""
    return samples_dir() / "segnet_real" / "weights.safetensors"


def trained_segmenters() -> list[str]:
    """Return the names in `SEGMENTERS` for which a trained compact network is shipped."""
    from semgrid_edu.networks import SEGMENTERS

    return [name for name in SEGMENTERS if (samples_dir() / f"{name}_compact").is_dir()]


def sample_weights(segmenter: str = "segnet") -> Path:
    """Return the file of a trained compact network, from image and occupancy grid to semantic grid.

    Parameters
    ----------
    segmenter : str
        Name of its image network, one of `trained_segmenters`.
    """
    from semgrid_edu.networks import WEIGHTS

    return _trained(segmenter) / WEIGHTS


def sample_image_stage(segmenter: str = "segnet") -> Path:
    """Return the file of the same network after its first stage, which is trained on labelled images but not on grids.

    Parameters
    ----------
    segmenter : str
        Name of its image network, one of `trained_segmenters`.
    """
    from semgrid_edu.networks import IMAGE_STAGE

    return _trained(segmenter) / IMAGE_STAGE


def _trained(segmenter: str) -> Path:
    """Return the folder of a trained compact network, or raise an error when there is none."""
    if segmenter not in (trained := trained_segmenters()):
        raise ArgumentError("segmenter", f"one of {', '.join(trained)}", repr(segmenter))
    return samples_dir() / f"{segmenter}_compact"


def sample_frames() -> list["Sample"]:
    """Return the shipped labelled frames of minikitti's training split, for experiments that take a minute."""
    from semgrid_edu.datasets.training_set import read_excerpt

    folder = samples_dir() / "frames"
    if not folder.is_dir():
        raise DataError(folder, "the frames of a clone of semgrid_edu", "no such folder: a wheel has none")
    return read_excerpt(folder)


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
    """
    folder = samples_dir() if folder is None else folder
    folders = (path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else ()
    samples = sorted(path for path in folders if not path.name.startswith("."))
    if not samples:
        raise DataError(folder, f"folders of samples, each with a {PROVENANCE}", "none")
    return [problem for sample in samples for problem in provenance_problems(sample)]
