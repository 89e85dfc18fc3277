"""nbgrader's settings for this course, written by `semgrid-edu course build`."""

import os
import sysconfig
from pathlib import Path

c = get_config()  # noqa: F821 (nbgrader defines it)
course = Path(__file__).resolve().parent

c.CourseDirectory.course_id = "semgrid_edu"
c.CourseDirectory.root = str(course)

# Seconds for one cell. An endless loop costs its own points and this long.
c.Execute.timeout = 30

# A test cell that a student deleted comes back for grading.
c.OverwriteCells.add_missing_cells = True


def put_first(variable: str, folder: str) -> None:
    """Put a folder before the others of a search path in the environment."""
    os.environ[variable] = os.pathsep.join(filter(None, [folder, os.environ.get(variable)]))


# Kernels that grade inherit this, and so find the hidden tests.
put_first("PYTHONPATH", str(course / "instructor"))

# nbgrader calls `alembic`, which lies beside it, also when its environment isn't activated.
put_first("PATH", sysconfig.get_path("scripts"))
