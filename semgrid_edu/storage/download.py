"""Downloads that go on where they broke off, and zip archives that are unpacked whole or not at all."""

import shutil
import stat
import time
import zipfile
import zlib
from pathlib import Path, PurePosixPath

import requests
from tqdm.auto import tqdm

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import named_errors, write_text

CHUNK = 2**16
"""Bytes that are read at once. When a connection breaks off, at most one such piece is lost."""

_BROKEN = (requests.ConnectionError, requests.Timeout, requests.exceptions.ChunkedEncodingError)
"""What `requests` raises when a connection can't be made or breaks off; a server's own fault (5xx) counts as that."""


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


class ResumingDownloader:
    """A downloader for `pooch` that keeps what it has when a connection breaks off, and then asks for the rest.

    After `attempts` attempts it gives up; the next download goes on from what was kept. What was kept is used only if
    the file still has the entity tag (HTTP's ETag) that it had then; without tags every attempt begins anew.

    Parameters
    ----------
    kept : path-like
        Where to keep what has arrived, until all has.
    attempts : int
        How often the connection is made before giving up.
    pause : float
        Seconds to wait before the second attempt; twice as long before each further one.
    timeout : float
        Seconds without any byte after which a connection counts as broken.

    Examples
    --------
    >>> downloader = ResumingDownloader("archives/.drive.zip.part")                   # doctest: +SKIP
    >>> pooch.retrieve(url, known_hash=None, path="archives", downloader=downloader)  # doctest: +SKIP
    """

    def __init__(self, kept: str | Path, attempts: int = 5, pause: float = 1.0, timeout: float = 30.0) -> None:
        self.kept, self.attempts, self.pause, self.timeout = Path(kept), attempts, pause, timeout
        self._tag = self.kept.with_name(f"{self.kept.name}.etag")

    def __call__(self, url: str, output_file: str, pooch: object = None) -> None:
        """Download a file.

        Parameters
        ----------
        url : str
            Where the file is.
        output_file : str
            Where to put it, on the disk on which `kept` is.
        pooch : object
            Not used: `pooch` hands itself over.

        Raises
        ------
        requests.RequestException
            When the server refuses, or every attempt broke off.
        """
        for attempt in range(self.attempts):
            try:
                self._get_rest(url)
                break
            except _BROKEN:
                if attempt + 1 == self.attempts:
                    raise
                time.sleep(self.pause * 2**attempt)
        self._tag.unlink(missing_ok=True)
        self.kept.replace(output_file)

    def _get_rest(self, url: str) -> None:
        """Ask for what is missing and append it, or begin anew when the server doesn't go on."""
        start = self.kept.stat().st_size if self.kept.exists() and self._tag.exists() else 0
        headers = {"Accept-Encoding": "identity"}
        if start:
            headers["Range"] = f"bytes={start}-"
        with requests.get(url, headers=headers, stream=True, timeout=self.timeout) as response:
            if start and not self._goes_on(response, start):
                self._forget()
                raise requests.ConnectionError("the file isn't the one of which a part was kept", response=response)
            if response.status_code >= requests.codes.server_error:
                raise requests.ConnectionError(f"{response.status_code} {response.reason}", response=response)
            response.raise_for_status()
            if response.status_code != requests.codes.partial_content:
                self._forget()
                start = 0
            self._append(response, start)

    def _goes_on(self, response: requests.Response, start: int) -> bool:
        """Return whether an answer is the rest of the same file, or the whole one from a server that gives no parts."""
        if response.status_code == requests.codes.partial_content:
            same = response.headers.get("ETag") == self._tag.read_text()
            return same and response.headers.get("Content-Range", "").startswith(f"bytes {start}-")
        return response.status_code != requests.codes.requested_range_not_satisfiable

    def _append(self, response: requests.Response, start: int) -> None:
        """Write an answer behind the first `start` bytes."""
        length = response.headers.get("Content-Length")
        total = start + int(length) if length else None
        if "ETag" in response.headers:
            write_text(self._tag, response.headers["ETag"])
        name = response.url.rpartition("/")[2]
        with (
            self.kept.open("ab") as file,
            tqdm(desc=name, total=total, initial=start, unit="B", unit_scale=True) as bar,
        ):
            for chunk in response.iter_content(CHUNK):
                with named_errors(self.kept):
                    file.write(chunk)
                bar.update(len(chunk))
        found = self.kept.stat().st_size
        if total is not None and found != total:
            raise requests.ConnectionError(f"{found} of {total} bytes arrived", response=response)

    def _forget(self) -> None:
        """Drop what was kept."""
        self.kept.unlink(missing_ok=True)
        self._tag.unlink(missing_ok=True)
