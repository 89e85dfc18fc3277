"""`semgrid-edu data fetch`: KITTI raw drives from their official archives, in the layout that `KittiRawDrive` reads."""

import re
import shutil
import zipfile
import zlib
from functools import partial
from pathlib import Path

from tqdm.auto import tqdm

from semgrid_edu.datasets.kitti_raw import KittiRawDrive, drive_folder
from semgrid_edu.errors import ArgumentError, DataError, needed
from semgrid_edu.storage.files import named_errors, sha256, write_text

pooch = needed("pooch")
requests = needed("requests")

KITTI_SOURCE = "https://s3.eu-central-1.amazonaws.com/avg-kitti/raw_data"
"""Where KITTI's archives are; https://www.cvlibs.net/datasets/kitti/raw_data.php links there."""

KITTI_LICENCE = (
    "KITTI is not part of this project. Its licence, CC BY-NC-SA 3.0, forbids commercial use and asks to cite "
    "Geiger, Lenz, Stiller and Urtasun, Vision meets Robotics: The KITTI Dataset, IJRR 2013."
)

PANDASET_LICENCE = (
    "Of PandaSet (Hesai and Scale AI, Xiao et al., ITSC 2021) only an excerpt is shipped. Its licence, CC BY 4.0 "
    "(https://creativecommons.org/licenses/by/4.0/) with the publisher's additional terms, asks for attribution and "
    "forbids identifying anyone or using the makers' names for publicity. https://pandaset.org describes it; its own "
    "download has ended, and https://github.com/scaleapi/pandaset-devkit/issues/151 says where copies are. Unpack "
    "a scene so that FOLDER/002 holds lidar, camera and annotations, then run "
    "`semgrid-edu demo FOLDER/002`."
)
"""Instructions for getting PandaSet, which a program can't download for the user."""

REGISTRY = "registry.txt"
"""The file beside the archives with their SHA-256 in pooch's format: a line `name sha256` for each."""

ATTEMPTS = 5
"""How often to connect before giving up; partial downloads are kept, also for the next call."""

CHUNK = 2**16
"""Bytes to read at once. If a connection breaks, at most one such piece is lost."""

_CALIBRATION = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt")


def fetch_kitti(folder: str | Path, drive: str, source: str = KITTI_SOURCE) -> KittiRawDrive:
    """Fetch a drive and the calibration of its day, unless they are on disk already.

    Archives go to the folder archives and may be deleted afterwards. An archive that is already there is unpacked
    without any network. A download that broke off is resumed when the function is called again.

    KITTI publishes no checksums. So the first archive of a name is trusted, once every file in it has passed the
    archive's own checksums, and its SHA-256 is written to archives/registry.txt. From then on an archive of this name
    must have it. If you know a checksum from elsewhere, write it there, and it is checked from the first download on.

    Parameters
    ----------
    folder : path-like
        Takes the folder of the day.
    drive : str
        Date and number of the drive, such as "2011_09_26_0013".
    source : str
        Where the archives are.

    Raises
    ------
    ArgumentError
        When `drive` isn't a date and a number.
    DataError
        When an archive can't be downloaded (the error says which file to put where), has another checksum than
        recorded, or is damaged.
    """
    folder = Path(folder)
    named = re.fullmatch(r"(\d{4}_(?:0[1-9]|1[0-2])_(?:0[1-9]|[12]\d|3[01]))_(?:drive_)?(\d{4})", drive, re.ASCII)
    if not named:
        raise ArgumentError("drive", "date and number such as 2011_09_26_0013", repr(drive))
    date, number = named.groups()
    target = drive_folder(folder, date, number)
    urls = []
    if not all((folder / date / name).exists() for name in _CALIBRATION):
        urls.append(f"{source}/{date}_calib.zip")
    if not target.exists():
        urls.append(f"{source}/{date}_drive_{number}/{target.name}.zip")
    files = _known_files((folder / "archives").absolute(), urls)
    for name in files.urls:
        archive = _download(files, name)
        unpack_zip(archive, folder, date)
        _record(files, name, archive)
    return KittiRawDrive(folder, date, number)


def _known_files(archives: Path, urls: list[str]) -> pooch.Pooch:
    """Return the archives by name, with their URLs and their checksums (None where the registry has none)."""
    names = {url.rpartition("/")[2]: url for url in urls}
    files = pooch.create(archives, base_url="", registry=dict.fromkeys(names), urls=names, retry_if_failed=ATTEMPTS - 1)
    if (archives / REGISTRY).exists():
        try:
            files.load_registry(archives / REGISTRY)
        except (OSError, UnicodeDecodeError) as error:
            raise DataError(archives / REGISTRY, "lines `name sha256`", error) from error
    return files


def _record(files: pooch.Pooch, name: str, archive: Path) -> None:
    """Add an archive's checksum to the registry if it is new."""
    if files.registry[name] is None:
        files.registry[name] = sha256(archive)
        known = {key: value for key, value in sorted(files.registry.items()) if value}
        write_text(Path(files.path) / REGISTRY, "".join(f"{key} {value}\n" for key, value in known.items()))


def _download(files: pooch.Pooch, name: str) -> Path:
    """Return the path of an archive, after downloading it if necessary."""
    archives = Path(files.path)
    known = files.registry[name]
    try:
        return Path(files.fetch(name, downloader=partial(_resume, archives / f".{name}.part")))
    except requests.HTTPError as error:
        refusal = f"{error.response.status_code} {error.response.reason}"
        raise DataError(files.urls[name], "an archive", f"{refusal}: is there such a drive?") from error
    except requests.RequestException as error:
        missing = " and ".join(url for name, url in files.urls.items() if not (archives / name).exists())
        by_hand = f"without network, put {missing} into {archives} by hand and call this again"
        raise DataError(files.urls[name], "an answer of the server", f"{type(error).__name__}; {by_hand}") from error
    except ValueError as error:
        expected = f"the SHA-256 {known} that {archives / REGISTRY} has"
        raise DataError(archives / name, expected, f"another one in the download from {files.urls[name]}") from error


def _resume(partial_file: Path, url: str, output_file: str, pooch: object) -> None:
    """Download a file for `pooch`, which retries when this raises an error: append to what has already arrived.

    If the file has changed on the server meanwhile, the archive's own checksums don't match when it is unpacked.
    """
    start = partial_file.stat().st_size if partial_file.exists() else 0
    headers = {"Accept-Encoding": "identity", "Range": f"bytes={start}-"} if start else {}
    with requests.get(url, headers=headers, stream=True, timeout=30) as response:
        if response.status_code == requests.codes.requested_range_not_satisfiable:
            partial_file.unlink()  # it is longer than the file on the server
        response.raise_for_status()
        if response.status_code != requests.codes.partial_content:
            start = 0
        size = start + int(response.headers.get("Content-Length", 0))
        name = url.rpartition("/")[2]
        bar = tqdm(desc=name, total=size or None, initial=start, unit="B", unit_scale=True)
        with bar, named_errors(partial_file), partial_file.open("ab" if start else "wb") as file:
            for chunk in response.iter_content(CHUNK):
                file.write(chunk)
                bar.update(len(chunk))
    if partial_file.stat().st_size < size:
        raise requests.ConnectionError(f"{partial_file.stat().st_size} of {size} bytes arrived")
    partial_file.replace(output_file)


def unpack_zip(archive: Path, folder: Path, top: str) -> None:
    """Unpack the top folder of an archive, whole or not at all.

    The archive is unpacked into a hidden folder first, which verifies the checksum of every file. Then its top folder
    is moved into place. Names that lead elsewhere can't leave the hidden folder, and links become plain files.

    Parameters
    ----------
    archive : Path
        The zip archive.
    folder : Path
        Where to put the top folder.
    top : str
        Name of the top folder; anything outside of it is dropped.

    Raises
    ------
    DataError
        When the archive is damaged or has no such folder; then nothing is unpacked.
    """
    hidden = folder / f".{archive.stem}.partial"
    shutil.rmtree(hidden, ignore_errors=True)
    try:
        with named_errors(folder), zipfile.ZipFile(archive) as opened:
            for info in tqdm(opened.infolist(), desc=f"unpacking {archive.name}", unit="file"):
                opened.extract(info, hidden)
        if not (hidden / top).is_dir():
            raise DataError(archive, f"a folder {top} in the archive", "none")
        _move(hidden / top, folder / top)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise DataError(archive, "a sound zip archive", f"{error}; delete it to download it again") from error
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _move(source: Path, target: Path) -> None:
    """Move a file or folder into place; if the folder is already there, move its contents."""
    if source.is_dir() and target.is_dir():
        for path in sorted(source.iterdir()):
            _move(path, target / path.name)
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
        source.replace(target)
