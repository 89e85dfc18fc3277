"""What a learning platform hands over: notebooks out of its archive, within limits, and no archive in the archive."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import BinaryIO
from zipfile import ZipFile, is_zipfile

from nbgrader.plugins import ExtractorPlugin

from semgrid_edu.workshop.course.nbgrader.gradebook import MAX_BYTES

MAX_DEPTH = 2
"""A platform puts notebooks into its archive, or into one folder a student; what lies deeper, a student put there."""


class UnpackNotebooks(ExtractorPlugin):
    """Takes notebooks from a platform's zip files, and from files that were unpacked by hand; the log names the rest.

    An archive that a student handed in stays as it is: the names in it are hers, and would tell who somebody is.
    """

    def extract(self, archive_path: str, extracted_path: str) -> None:
        """Copy the notebooks; a zip file gets a folder of its own.

        Parameters
        ----------
        archive_path, extracted_path : str
            The two folders.
        """
        for path in sorted(one for one in Path(archive_path).rglob("*") if one.is_file() and not one.is_symlink()):
            by_platform = path.parent == Path(archive_path) and is_zipfile(path)
            where = Path(extracted_path, path.stem) if by_platform else Path(extracted_path)
            found = (
                _members(path) if by_platform else [(path.relative_to(archive_path), path.stat().st_size, path.open)]
            )
            for name, size, opened in found:
                if (
                    name.suffix != ".ipynb"
                    or len(name.parts) > MAX_DEPTH
                    or name.anchor
                    or ".." in name.parts
                    or "\\" in name.name  # a pattern may take what stands before it for a folder
                    or size > MAX_BYTES
                ):
                    self.log.warning("Left out, no notebook, too large or too deep: %s in %s", name, path)
                    continue
                (where / name).parent.mkdir(parents=True, exist_ok=True)
                with opened("rb") as source, (where / name).open("wb") as target:
                    shutil.copyfileobj(source, target)


def _members(archive: Path) -> Iterator[tuple[PurePosixPath, int, Callable[[str], BinaryIO]]]:
    """Yield name and size of each file in a zip file, and a function that opens it; no more than the size is read."""
    with ZipFile(archive) as file:
        for member in file.infolist():
            if not member.is_dir():
                yield PurePosixPath(member.filename), member.file_size, lambda _, one=member: file.open(one)
