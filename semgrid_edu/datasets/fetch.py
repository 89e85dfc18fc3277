"""KITTI raw drives from their official archives: fetched, checked, unpacked where `KittiRawDrive` reads them."""

import re
from pathlib import Path

import pooch
import requests

from semgrid_edu.datasets.kitti_raw import KittiRawDrive, drive_folder
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.download import ResumingDownloader
from semgrid_edu.storage.files import sha256, write_text
from semgrid_edu.storage.unpacking import unpack_zip

KITTI_SOURCE = "https://s3.eu-central-1.amazonaws.com/avg-kitti/raw_data"
"""Where KITTI's archives are; https://www.cvlibs.net/datasets/kitti/raw_data.php links there."""

KITTI_LICENCE = (
    "KITTI is not part of this project. Its licence, CC BY-NC-SA 3.0, forbids commercial use and asks to cite "
    "Geiger, Lenz, Stiller and Urtasun, Vision meets Robotics: The KITTI Dataset, IJRR 2013."
)

REGISTRY = "registry.txt"
"""The file beside the archives that holds their SHA-256, in pooch's form: a line `name sha256` for each."""

_CALIBRATION = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt")


def fetch_kitti(folder: str | Path, drive: str, source: str = KITTI_SOURCE) -> KittiRawDrive:
    """Get a drive and the calibration of its day, unless they are there.

    Archives go to the folder archives and may be deleted afterwards. An archive that lies there already is unpacked
    without any network. A download that breaks off goes on when the function is called again.

    KITTI publishes no checksums. So the first archive of a name is trusted, once every file in it has passed the
    archive's own checksums, and its SHA-256 is written to archives/registry.txt. From then on an archive of this name
    must have it. Write a checksum there that you know from elsewhere, and it holds from the first download on.

    Parameters
    ----------
    folder : path-like
        Takes the folder of the day.
    drive : str
        Date and number of the drive, such as "2011_09_26_0013".
    source : str
        Where the archives are.

    Returns
    -------
    KittiRawDrive

    Raises
    ------
    ArgumentError
        When `drive` isn't a date and a number.
    DataError
        When an archive can't be got (the error says which file to put where), has another checksum than recorded, or
        is damaged.
    """
    folder, named = Path(folder), re.fullmatch(r"(\d{4}_\d\d_\d\d)_(?:drive_)?(\d{4})", drive)
    if not named:
        raise ArgumentError("drive", "date and number such as 2011_09_26_0013", repr(drive))
    date, number = named.groups()
    if not all((folder / date / name).exists() for name in _CALIBRATION):
        _fetch_archive(folder, f"{source}/{date}_calib.zip", date)
    target = drive_folder(folder, date, number)
    if not target.exists():
        _fetch_archive(folder, f"{source}/{date}_drive_{number}/{target.name}.zip", date)
    return KittiRawDrive(folder, date, number)


def _fetch_archive(folder: Path, url: str, date: str) -> None:
    """Get an archive, unpack it, and record its checksum when none was known."""
    archives, name = (folder / "archives").absolute(), url.rpartition("/")[2]
    files = pooch.create(archives, base_url="", registry={name: None}, urls={name: url})
    if (archives / REGISTRY).exists():
        _load_registry(files, archives / REGISTRY)
    archive = _download(files, archives, name)
    unpack_zip(archive, folder, date)
    if files.registry[name] is None:
        recorded = files.registry | {name: sha256(archive)}
        write_text(archives / REGISTRY, "".join(f"{key} {value}\n" for key, value in sorted(recorded.items())))


def _load_registry(files: pooch.Pooch, path: Path) -> None:
    try:
        files.load_registry(path)
    except OSError as error:
        raise DataError(path, "lines `name sha256`", error) from error


def _download(files: pooch.Pooch, archives: Path, name: str) -> Path:
    """Return where an archive is, after a download if it isn't there."""
    known, by_hand = files.registry[name], f"without network, put {name} into {archives} and give the command again"
    try:
        return Path(files.fetch(name, downloader=ResumingDownloader(archives / f".{name}.part")))
    except requests.HTTPError as error:
        refusal = f"{error.response.status_code} {error.response.reason}"
        raise DataError(files.urls[name], "an archive", f"{refusal}: is there such a drive?") from error
    except requests.RequestException as error:
        raise DataError(files.urls[name], "an answer of the server", f"{type(error).__name__}; {by_hand}") from error
    except ValueError as error:
        expected = f"the SHA-256 {known} that {archives / REGISTRY} has"
        raise DataError(archives / name, expected, f"another one in the download from {files.urls[name]}") from error
