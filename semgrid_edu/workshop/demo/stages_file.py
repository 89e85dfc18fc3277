"""Read a student's own stages from a Python file, for `semgrid-edu demo --stages my_stages.py`."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.stages import REMEMBER, STAGES, Stages
from semgrid_edu.stages.hints import in_short


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
        found = "another file" if path.is_file() else "a folder" if path.is_dir() else "no such file"
        raise DataError(path, f"a Python file with functions named {names}", found)
    module = _imported(path)
    found = {name: getattr(module, name) for name in STAGES | REMEMBER if hasattr(module, name)}
    if not found:
        others = [name for name, value in vars(module).items() if callable(value) and not name.startswith("_")]
        raise DataError(path, f"at least one function named {names}", ", ".join(others) or "no function at all")
    try:
        return Stages(**found)
    except ArgumentError as error:
        name, expected, wrong = error.args
        raise DataError(path, f"{name} to be {expected}", wrong) from error


def _imported(path: Path) -> ModuleType:
    """Execute a file as a module; meanwhile its own folder is searched for imports too."""
    spec = spec_from_file_location(f"_stages_in_{path.stem}", path)
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
