"""Zip archives that are unpacked whole or not at all, and nowhere but in their folder."""

import shutil
import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from tqdm.auto import tqdm

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import named_errors


def unpack_zip(archive: Path, folder: Path, top: str) -> None:
    """Unpack an archive.

    It grows in a hidden folder beside its target and is then moved into place, a folder that wasn't there before by a
    single renaming. So a process that is killed leaves no half drive. The checksum of every file is verified.

    Parameters
    ----------
    archive : Path
        The zip archive.
    folder : Path
        Takes what is in the archive.
    top : str
        The only folder at the top of the archive.

    Raises
    ------
    DataError
        When the archive is damaged, or holds a link or something outside of `top`; then nothing is unpacked.
    """
    hidden = folder / f".{archive.stem}.partial"
    shutil.rmtree(hidden, ignore_errors=True)
    try:
        with named_errors(folder), zipfile.ZipFile(archive) as opened:
            for info in opened.infolist():
                _check_member(archive, info, top)
            for info in tqdm(opened.infolist(), desc=f"unpacking {archive.name}", unit="file"):
                opened.extract(info, hidden)
        _move(hidden / top, folder / top)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise DataError(archive, "a sound zip archive", f"{error}; delete it to get it anew") from error
    except FileNotFoundError as error:
        raise DataError(archive, f"a folder {top} in the archive", "none") from error
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _check_member(archive: Path, info: zipfile.ZipInfo, top: str) -> None:
    """Refuse what would be unpacked elsewhere."""
    name = PurePosixPath(info.filename.replace("\\", "/"))
    if name.parts[:1] != (top,) or ".." in name.parts:
        raise DataError(archive, f"only names below {top}/", repr(info.filename))
    if stat.S_ISLNK(info.external_attr >> 16):
        raise DataError(archive, "files and folders", f"the link {info.filename!r}")


def _move(source: Path, target: Path) -> None:
    """Move a file or folder into place; into a folder that is there already, what it holds."""
    if source.is_dir() and target.is_dir():
        for path in sorted(source.iterdir()):
            _move(path, target / path.name)
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
        source.replace(target)
