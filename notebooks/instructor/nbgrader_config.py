"""nbgrader's settings for this course, written by `semgrid-edu course build`."""

import os
import sys
import sysconfig
from pathlib import Path

from nbconvert.preprocessors import ClearMetadataPreprocessor
from nbgrader.preprocessors import (
    AssignLatePenalties,
    CheckCellMetadata,
    ClearOutput,
    LimitOutput,
    OverwriteCells,
    OverwriteKernelspec,
    SaveAutoGrades,
)

from semgrid_edu.workshop.course.nbgrader.preprocessors import ExecuteApart, MakeWhole, NoteCrashes, ShowRubric

c = get_config()  # noqa: F821 (nbgrader defines it)
course = Path(__file__).resolve().parent

c.CourseDirectory.course_id = "semgrid_edu"
c.CourseDirectory.root = str(course)

# What `nbgrader autograde` does to a submission: first it repairs it, then it runs and grades it.
c.Autograde.sanitize_preprocessors = [
    ClearOutput,
    MakeWhole,
    OverwriteKernelspec,
    OverwriteCells,
    CheckCellMetadata,
]
c.Autograde.autograde_preprocessors = [
    ExecuteApart,
    ClearMetadataPreprocessor,
    LimitOutput,
    SaveAutoGrades,
    NoteCrashes,
    AssignLatePenalties,
    CheckCellMetadata,
    ShowRubric,
]

# The formgrader and feedback show a submission's text without the scripts that it may hold.
c.HTMLExporter.filters = {"strip_files_prefix": "semgrid_edu.workshop.course.nbgrader.cleaning.without_scripts"}

# A file that was handed in and is opened in Formgrader runs no script there.
if formgrader := sys.modules.get("nbgrader.server_extensions.formgrader.handlers"):
    formgrader.SubmissionFilesHandler.content_security_policy = "sandbox; default-src 'none'"

# What a platform's archive holds is unpacked within limits, and no archive in it.
c.ZipCollectApp.extractor_plugin = "semgrid_edu.workshop.course.nbgrader.collecting.UnpackNotebooks"

c.ExecuteApart.course = c.ShowRubric.course = str(course)

# Seconds for one cell. An endless loop costs its own points and this long.
c.ExecuteApart.timeout = 30

# nbgrader calls `alembic`, which lies beside it, also when its environment isn't activated.
os.environ["PATH"] = os.pathsep.join(filter(None, [sysconfig.get_path("scripts"), os.environ.get("PATH")]))
