"""A student's own stages: read from a Python file, and compared with the package's on the demo's page."""

import sys
from dataclasses import dataclass
from html import escape
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.stages import REMEMBER, STAGES, Stages
from semgrid_edu.stages.hints import in_short
from semgrid_edu.storage.files import found_at

MADE_BY = {
    "scores": ("segment",),
    "occupancy": ("track",),
    "grid": ("track", "segment", "sample", "fuse"),
    "refined": ("track", "segment", "sample", "fuse", "refine"),
    "remembered": ("track", "segment", "sample", "fuse", "remember"),
}
"""The stages on which each picture of the page depends."""

STAGE_WORDS = {
    "track": ("l → o", "Bayes filter, CMCDOT"),
    "segment": ("i → s", "image network"),
    "sample": ("s → p", "sampling on planes"),
    "fuse": ("(p, o) → g", "reduction and fusion"),
    "refine": ("g → g", "CRF, mean field"),
    "remember": ("g → g", "memory of classes"),
}
"""Input and output of each stage, in the symbols of the paper's Fig. 2, and what the package's own stage does."""


@dataclass(frozen=True)
class Comparison:
    """Which stages of the second run come from a student's file; all others are the package's in both runs.

    Parameters
    ----------
    file : str
        Name of the student's file, without its folder.
    stages : tuple of str
        Names of the stages that the file defines, such as ("track", "refine").
    memory : bool
        Whether both runs remember classes over frames.
    """

    file: str
    stages: tuple[str, ...]
    memory: bool = False

    @property
    def changed(self) -> tuple[str, ...]:
        """The pictures that these stages can change. The page shows each of them twice."""
        return tuple(name for name in pictures_of(self.memory) if set(MADE_BY[name]) & set(self.stages))

    def lead(self) -> str:
        """Return the sentences that open the page, as HTML."""
        named = _listed([f"<b>{name}</b> ({STAGE_WORDS[name][0]})" for name in self.stages])
        return (
            f"This page compares two runs over the same frames. The first is the package's own. In the second, {named} "
            f"{'comes' if len(self.stages) == 1 else 'come'} from <b>{escape(self.file)}</b>, and the other stages are "
            "the package's. A picture that can differ is shown twice, the package's first."
        )

    def made_with(self, picture: str) -> str:
        """Say which of the file's stages a picture depends on.

        Parameters
        ----------
        picture : str
            Name of the picture, a key of `MADE_BY`.

        Returns
        -------
        str
            Two sentences, as HTML.
        """
        stages = [f"<b>{name}</b>" for name in self.stages if name in MADE_BY[picture]]
        return f"Made with {_listed(stages)} of {escape(self.file)}. Where does it differ from the package's picture?"


def pictures_of(memory: bool) -> tuple[str, ...]:
    """Return the names of the pictures that a run makes.

    Parameters
    ----------
    memory : bool
        Whether it remembers classes over frames.
    """
    return tuple(name for name in MADE_BY if memory or name != "remembered")


def _listed(words: list[str]) -> str:
    """Join words as in a sentence: "a, b and c"."""
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last


def load_stages(path: str | Path) -> Stages:
    """Read stages from a Python file: what it calls track, segment, sample, fuse, refine and remember.

    Parameters
    ----------
    path : path-like
        The file, which is executed. Python also looks for its imports in its folder, so it can import files beside it.

    Returns
    -------
    Stages
        The stages of the file; the others are left out.

    Raises
    ------
    DataError
        When there is no such file, Python can't import it, it has none of these stages, or one of them doesn't take the
        right number of arguments.

    Examples
    --------
    >>> list(run_pipeline(drive, load_stages("my_stages.py")))                          # doctest: +SKIP
    """
    path = Path(path)
    names = ", ".join(STAGES | REMEMBER)
    if path.suffix != ".py" or not path.is_file():
        found = "another file" if path.is_file() else found_at(path)
        raise DataError(path, f"a Python file with functions named {names}", found)
    module = imported(path)
    found = {name: getattr(module, name) for name in STAGES | REMEMBER if hasattr(module, name)}
    if not found:
        others = [name for name, value in vars(module).items() if callable(value) and not name.startswith("_")]
        raise DataError(path, f"at least one function named {names}", ", ".join(others) or "no function at all")
    try:
        return Stages(**found)
    except ArgumentError as error:
        name, expected, wrong = error.args
        raise DataError(path, f"{name} to be {expected}", wrong) from error


def imported(path: Path) -> ModuleType:
    """Execute a file as a module; meanwhile its own folder is searched for imports too.

    Parameters
    ----------
    path : Path
        A Python file.

    Raises
    ------
    DataError
        When it raises an error or ends the program.
    """
    spec = spec_from_file_location(f"_read_from_{path.stem}", path)
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # a dataclass in the file looks up its module there
    searched = sys.path[:]
    sys.path.insert(0, str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise DataError(path, "a file that Python can import", in_short(error, spec.origin)) from error
    finally:
        sys.path[:] = searched
    return module
