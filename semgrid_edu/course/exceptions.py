"""Which lectures may break which rules until their second edition: a list that only gets shorter."""

from collections.abc import Collection, Mapping

from nbformat import NotebookNode

from semgrid_edu.course.rules import RULES, Rule

NOT_YET = frozenset({"predictions", "plot code", "alternative texts", "resolution"})

EXCEPTIONS: Mapping[str, frozenset[str]] = {
    "00_tour": NOT_YET,
    "01_bayes": frozenset({"alternative texts"}),
    "02_grids": NOT_YET - {"resolution"} | {"length"},
    "03_bof": NOT_YET - {"resolution"} | {"length"},
    "04_cmcdot": NOT_YET | {"length"},
    "05_pixels": NOT_YET | {"length"},
    "06_planes": NOT_YET | {"length"},
    "07_segmentation": NOT_YET | {"length"},
    "08_fusion": NOT_YET | {"length"},
}
"""The rules that each lecture may break, by their names in `RULES`. An exception that isn't needed is a problem too."""


def rule_problems(
    notebook: NotebookNode, rules: Mapping[str, Rule] = RULES, allowed: Collection[str] = ()
) -> list[str]:
    """List where a notebook breaks a rule without having an exception, and the exceptions that it no longer needs.

    Parameters
    ----------
    notebook : NotebookNode
        An executed notebook.
    rules : mapping of str to Rule
        The rules to check, by name.
    allowed : collection of str
        Names of the rules that this notebook may break.

    Returns
    -------
    list of str
        One sentence per problem; empty when there is none.
    """
    problems = []
    for name, rule in rules.items():
        found = rule(notebook)
        if name in allowed and not found:
            problems.append(f"keeps the rule on {name}; take its exception out of semgrid_edu/course/exceptions.py")
        problems += [] if name in allowed else found
    return problems
