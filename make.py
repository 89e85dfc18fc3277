"""What `make demo`, `make test` and the other targets do, for machines without make.

`python make.py demo` in a clone needs nothing but Python's own library, since it makes the environment in
which everything else is installed.
"""

import os
import subprocess
import sys
import venv
from pathlib import Path

CLONE = Path(__file__).resolve().parent
"""The folder of this file."""
ENVIRONMENT = CLONE / ".venv"
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
MADE = ENVIRONMENT / "made"
"""The file whose time says when the environment was made."""
NEEDS = ("pyproject.toml", "constraints.txt")
"""The files that decide what is installed; when one is newer, the environment is brought up to date."""
OLDEST = (3, 11)
"""The oldest Python that will do."""
REAL_DATA = ("KITTI", "SEMANTIC_KITTI", "PANDASET")
"""Environment variables that name folders of real data."""


def environment() -> None:
    """Make `.venv` with all that demo and tests need, or bring it up to date; nothing is done when it is.

    What numba compiles is part of it: demo and tests then find it compiled.
    """
    if sys.version_info < OLDEST:
        found = f"{sys.executable} is {sys.version.split()[0]}; set PYTHON=... for make"
        sys.exit(f"Python {OLDEST[0]}.{OLDEST[1]} or later is needed, {found}")
    if MADE.exists() and all((CLONE / name).stat().st_mtime <= MADE.stat().st_mtime for name in NEEDS):
        return
    venv.create(ENVIRONMENT, with_pip=True, symlinks=os.name != "nt")
    _run("python", "-m", "pip", "install", "--quiet", "-c", "constraints.txt", "-e", ".[test]")
    print("compiling the filters, the CRF and the simulator, once for this clone: about a minute", flush=True)
    _run("python", "compile_functions.py", OMP_NUM_THREADS="1", NUMBA_NUM_THREADS="1")
    MADE.touch()


def demo() -> None:
    """Run the whole pipeline on the shipped drive and write out/demo/index.html."""
    environment()
    _run("semgrid-edu", "demo", "--out", str(Path("out") / "demo"))


def lint() -> None:
    """Check style and format of the code."""
    environment()
    _run("python", "-m", "ruff", "check", ".")
    _run("python", "-m", "ruff", "format", "--check", ".")


def test() -> None:
    """Check the code, run every test, and run every notebook and compare what it prints."""
    lint()
    folder = CLONE / "notebooks"
    notebooks = [
        str(path.relative_to(CLONE)) for path in sorted([*folder.glob("*.ipynb"), *folder.glob("deeper/*.ipynb")])
    ]
    # Four processes for two cores: two wait for a kernel, a subprocess or the disk most of the time. The files that
    # take minutes come first, so that no process ends long before the others. Graders are one class an exercise.
    pool = ("-n", "4", "--dist", "loadscope", "--no-loadscope-reorder", "-p", "no:cacheprovider")
    nbval = ("--nbval", "--nbval-current-env", "--nbval-cell-timeout=300")
    _pytest(*pool, *nbval, "--ignore=tests/browser", *notebooks, "tests")


def quick() -> None:
    """Check the code and run the tests that need neither notebooks nor graders: two minutes, for each push."""
    lint()
    slow = ("graders", "browser", "notebooks", "experiments", "course", "real")
    _pytest("-n", "3", "--dist", "loadfile", "tests", *(f"--ignore=tests/{folder}" for folder in slow))


def test_real() -> None:
    """Run the tests that need real sensor data; KITTI=..., SEMANTIC_KITTI=... and PANDASET=... name its folders."""
    environment()
    folders = {name: str(Path(os.environ[name]).resolve()) for name in REAL_DATA if os.environ.get(name)}
    if not folders:
        sys.exit(f"usage: make test-real KITTI=<folder that holds 2011_09_26>; also {' and '.join(REAL_DATA[1:])}")
    _pytest("-m", "real", "tests", **folders)


def notebooks() -> None:
    """Execute the sources of all lectures, companions and exercises, and write the notebooks."""
    environment()
    _run("semgrid-edu", "course", "notebooks")


def bench() -> None:
    """Run every benchmark; each prints ratios between ways to do the same."""
    environment()
    _run("python", "-m", "pip", "install", "--quiet", "-c", "constraints.txt", "-e", ".[bench]")
    for script in sorted((CLONE / "benchmarks").glob("bench_*.py")):
        _run("python", str(script.relative_to(CLONE)))


def test_browser() -> None:
    """Test the demo's page and a lecture's widget in a real browser; skipped where there is none."""
    environment()
    _run("python", "-m", "pip", "install", "--quiet", "-c", "constraints.txt", "-e", ".[browser]")
    _pytest("tests/browser")


def _pytest(*arguments: str, **variables: str) -> None:
    """Run pytest with one thread a process, because several processes share two cores."""
    variables |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    # Hundreds of processes read the bytecode of the first one, even where the environment forbids to write it.
    _run("python", "-m", "pytest", *arguments, PYTHONDONTWRITEBYTECODE="", **variables)


def _run(program: str, *arguments: str, **variables: str) -> None:
    """Run a program of the environment in the clone; when it fails, end with its exit status."""
    # Idle OpenMP threads sleep instead of spinning, so that processes can share the cores.
    variables = os.environ | {"OMP_WAIT_POLICY": "PASSIVE"} | variables
    done = subprocess.run([BIN / program, *arguments], cwd=CLONE, env=variables, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def site() -> None:
    """Build the course site, out/site/index.html; fails on a warning, a dead link, or a figure without words."""
    environment()
    _run("python", "-m", "pip", "install", "--quiet", "-c", "constraints.txt", "-e", ".[site]")
    sources, trees, pages = (str(Path("out") / name) for name in ("site-sources", "site-trees", "site"))
    _run("python", "docs/site/stage.py", sources)
    _run("python", "-m", "sphinx", "--quiet", "--fail-on-warning", "-E", "-d", trees, sources, pages)
    _run("python", "docs/site/check.py", pages)


_ALL = (environment, demo, lint, quick, test, test_browser, test_real, notebooks, bench, site)
TARGETS = {target.__name__.replace("_", "-"): target for target in _ALL}
"""The targets by name."""


def make_targets(asked: list[str]) -> None:
    """Do what the command line asks for.

    Parameters
    ----------
    asked : list of str
        Keys of `TARGETS`, at least one.

    Raises
    ------
    SystemExit
        When something else is asked for, or a target fails.
    """
    if not asked or not set(asked) <= TARGETS.keys():
        sys.exit(f"usage: python make.py [{' | '.join(TARGETS)}]")
    for target in asked:
        TARGETS[target]()


if __name__ == "__main__":
    make_targets(sys.argv[1:])
