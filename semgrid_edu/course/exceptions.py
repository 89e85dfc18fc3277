"""Which lectures may break which rules until their second edition: one list, which only gets shorter."""

from collections.abc import Collection, Mapping

from nbformat import NotebookNode

from semgrid_edu.course.rules import RULES, Rule

NOT_YET = frozenset({"minutes", "predictions", "plot code", "alternative texts", "resolution"})

EXCEPTIONS: Mapping[str, frozenset[str]] = {
    "00_tour": NOT_YET,
    "01_bayes": NOT_YET | {"length"},
    "02_grids": NOT_YET | {"length"},
    "03_bof": NOT_YET | {"length"},
    "04_cmcdot": NOT_YET | {"length"},
    "05_pixels": NOT_YET | {"length"},
    "06_planes": NOT_YET | {"length"},
    "07_segmentation": NOT_YET | {"length"},
    "08_fusion": NOT_YET | {"length"},
}
"""For each lecture the names of rules, as in `RULES`. An exception that is no longer needed is a problem itself."""


def rule_problems(
    notebook: NotebookNode, rules: Mapping[str, Rule] = RULES, allowed: Collection[str] = ()
) -> list[str]:
    """List what breaks a rule without an exception, and the exceptions that nothing needs.

    Parameters
    ----------
    notebook : NotebookNode
        Executed.
    rules : mapping of str to Rule
        Those to keep, by name.
    allowed : collection of str
        The rules that this notebook may break.
    """
    problems = []
    for name, rule in rules.items():
        found = rule(notebook)
        if name in allowed and not found:
            problems.append(f"keeps the rule on {name}; take its exception out of semgrid_edu/course/exceptions.py")
        problems += [] if name in allowed else found
    return problems
