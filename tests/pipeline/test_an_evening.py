"""A frame can be read in an evening: what `run_frame` reaches without `fast` is short (docs/house.md)."""

import ast
import sys
from functools import cache
from pathlib import Path

from code_lines import code_lines

import semgrid_edu
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.networks import load_net
from semgrid_edu.pipeline import Stages, run_frame

PACKAGE = Path(semgrid_edu.__file__).parent
MOST_LINES = 1000
MOST_FILES = 20


@cache
def functions(file: str) -> list[ast.FunctionDef]:
    nodes = ast.walk(ast.parse(Path(file).read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.FunctionDef)]


def reached(work) -> set[tuple[str, int, int]]:
    """File, first and last line of every function of the package that is called while `work` runs."""
    called = set()

    def note(frame, event, _):
        if event == "call" and Path(frame.f_code.co_filename).is_relative_to(PACKAGE):
            called.add((frame.f_code.co_filename, frame.f_code.co_firstlineno))

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    found = set()
    for file, line in called:
        around = [node for node in functions(file) if first_line(node) <= line <= node.end_lineno]
        if around:
            innermost = max(around, key=first_line)
            found.add((file, first_line(innermost), innermost.end_lineno))
    return found


def first_line(node: ast.FunctionDef) -> int:
    return min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])


def test_what_a_frame_reaches_can_be_read_in_an_evening():
    drive = sample_drive()
    stages = Stages.of(load_net(sample_weights(), drive.camera), memory=True)
    run_frame(drive[0], stages)  # the first frame moves nothing
    frame = drive[1]
    found = reached(lambda: run_frame(frame, stages))
    lines = {(file, line) for file, first, last in found for line in code_lines(file) & set(range(first, last + 1))}
    files = {file for file, *_ in found}
    print(f"{len(found)} functions, {len(lines)} code lines, {len(files)} files")
    assert not any("/fast/" in file for file in files)
    assert len(files) > 15  # all stages were seen
    assert len(lines) <= MOST_LINES
    assert len(files) <= MOST_FILES
